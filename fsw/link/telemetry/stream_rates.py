"""Message schedule of one link, and its changes by SET_MESSAGE_INTERVAL.

On a line that is too slow for what is wanted all intervals are stretched alike, but those of what
is vital.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

from fsw.autopilot.ports import Clock
from fsw.link.bounded_memory import renew
from fsw.link.telemetry.streams import Stream
from messages.frames import whole_size

SLOT_US: Final = 10_000  # what is due within one slot leaves together, in one datagram
OFF: Final = -1  # MESSAGE_INTERVAL: not sent
UNKNOWN: Final = 0  # MESSAGE_INTERVAL: not available
_RENEWED: Final = 0.2  # of a size by each frame
_NOTICED: Final = 0.02  # change of the share
_MIN_SHARE: Final = 0.1  # of a line
_MAX_ASKERS: Final = 8  # whose wishes are remembered: more than a link has peers
_MAX_PER_SECOND: Final = 1500  # of all messages on a link: 3 % of a core
_FULL: Final = 0.8  # of what a line carries
TELEMETRY: Final = 0.6  # of the same
_BURST_S: Final = 0.1  # of that share may leave at once
_LONGEST: Final = 1400  # bytes of what can wait, which are sent as one


@dataclass(slots=True)
class _Timetable:
    """One stream: every ``interval_us`` from ``due_us`` on, not at all if OFF."""

    stream: Stream
    default_us: int
    wanted_us: int
    due_us: int
    size: float  # bytes of a frame: all of its fields, and then as measured
    interval_us: int = OFF  # in force
    wishes: dict[object, int] = field(default_factory=dict)  # intervals [us], by who asked

    def want(self, listeners: Collection[object]) -> None:
        """Take the shortest interval that anybody wishes: who has asked for none, the default.

        So does who cannot speak before it hears us, of what is vital.
        """
        wishes = [*self.wishes.values()]
        if self.stream.vital or any(one not in self.wishes for one in listeners):
            wishes.append(self.default_us)
        self.wanted_us = min((wish for wish in wishes if wish != OFF), default=OFF)


class LineBudget:
    """What a line of limited speed may be given, so that nothing important waits behind the rest.

    The line is never planned more than 80 % full: its clock, and the radio behind it, are slower
    now and then. Telemetry is planned for 60 %; answers, parameters and files have the rest. What
    was sent counts against wall time, however fast the vehicle's time goes.
    """

    def __init__(self, bytes_per_s: float, clock: Clock) -> None:
        """Begin with an empty line that carries ``bytes_per_s``; the clock is wall time [us]."""
        self._rate = _FULL * bytes_per_s
        self._most = self._level = _BURST_S * self._rate
        self._clock = clock
        self._counted_us = clock()

    def spend(self, size: int) -> None:
        """Count ``size`` [bytes] that are sent; what is urgent may overdraw."""
        self._count()
        self._level -= size

    def has_room(self) -> bool:
        """Whether what can wait may be sent now: parameters, files."""
        self._count()
        return self._level > 0.0

    def takes_telemetry(self) -> bool:
        """Whether telemetry may be sent now; what was sent before it of what can wait is no reason.

        In real time it always may. Where the vehicle's time goes faster, some of it is left out.
        """
        self._count()
        return self._level > -self._most - _LONGEST

    def _count(self) -> None:
        now_us = self._clock()
        earned = 1e-6 * (now_us - self._counted_us) * self._rate
        self._level = min(self._level + earned, self._most)
        self._counted_us = now_us


class StreamRates:
    """The timetable of one link, in sensor time: the same in real time and in lockstep."""

    def __init__(
        self,
        streams: Sequence[Stream],
        rates_hz: Sequence[float],
        tick_us: int,
        *,
        max_bytes_s: float | None = None,
    ) -> None:
        """Lay out the defaults, at most one message a tick; a rate of 0 is sent on request only.

        All of them together send no more than ``max_bytes_s`` [bytes/s] on average.
        """
        self._tick_us = tick_us
        self._max_bytes_s = max_bytes_s
        self._listeners: Collection[object] = ()
        self._begun = False
        self._rows = []
        for place, (stream, rate_hz) in enumerate(zip(streams, rates_hz, strict=True)):
            interval = round(1e6 / rate_hz) if rate_hz > 0.0 else OFF
            # Spread over the slots, so that slow messages do not all leave at once.
            phase = place * SLOT_US % interval if interval != OFF else 0
            size = whole_size(stream.message_id)
            self._rows.append(_Timetable(stream, interval, interval, phase, size))
        self._by_stream = {row.stream: row for row in self._rows}
        self._lay_out()
        for row in self._rows:
            # The first ones do not all leave in the first second either.
            row.due_us = row.due_us if row.stream.vital else round(row.due_us / self.share)

    def due(self, t_us: int) -> Iterator[Stream]:
        """Streams to be sent now; a pause is not caught up on."""
        if not self._begun:
            self._begun = True
            for row in self._rows:
                row.due_us += t_us
        for row in self._sent:
            if row.due_us <= t_us:
                row.due_us += row.interval_us
                if row.due_us <= t_us:
                    row.due_us = t_us + row.interval_us
                yield row.stream

    def note_size(self, stream: Stream, size: int) -> None:
        """How large [bytes] a frame of a stream is: the zeros at its end are not sent."""
        row = self._by_stream[stream]
        row.size += _RENEWED * (size - row.size)

    def fit(self) -> None:
        """Take the sizes of late frames for the next ones; call it once a second."""
        if abs(self._share() - self.share) > _NOTICED:
            self._lay_out()

    def interval_us(self, message_id: int) -> int:
        """The interval in force, OFF, or UNKNOWN for a message that does not exist."""
        for row in self._rows:
            if row.stream.message_id == message_id:
                return row.interval_us
        return UNKNOWN

    def heard_by(self, listeners: Collection[object]) -> None:
        """Who listens and may ask: nobody loses to another's wish what it has not given up."""
        if listeners != self._listeners:
            self._listeners = listeners
            for row in self._rows:
                if row.wishes:
                    row.want(listeners)
            self._lay_out()

    def set_interval(
        self, message_id: int, interval_us: int, t_us: int, asker: object = None
    ) -> str:
        """Change how often a message is sent, 0 as by default, -1 never; says why not.

        Of what several ask for the shortest interval [us] counts.
        """
        rows = [row for row in self._rows if row.stream.message_id == message_id]
        if not rows:
            return f"message {message_id} is not one that this vehicle sends"
        if interval_us < OFF or 0 < interval_us < self._tick_us:
            return f"interval {interval_us} us is shorter than a tick, {self._tick_us} us"
        before = [(row.wishes, row.wanted_us) for row in rows]
        for row in rows:
            row.wishes = dict(row.wishes)
            renew(row.wishes, asker, interval_us or row.default_us, _MAX_ASKERS)
            row.want(self._listeners)
            row.due_us = t_us + max(row.wanted_us, 0)
        per_second = sum(1e6 / row.wanted_us for row in self._rows if row.wanted_us != OFF)
        if per_second > _MAX_PER_SECOND:
            for row, (wishes, wanted) in zip(rows, before, strict=True):
                row.wishes, row.wanted_us = wishes, wanted
            return f"more than {_MAX_PER_SECOND} messages a second on one link"
        self._begun = True
        self._lay_out()
        return ""

    def _lay_out(self) -> None:
        self.share = self._share()  # of the wanted rates, of all that is not vital
        for row in self._rows:
            stretched = row.wanted_us != OFF and not row.stream.vital
            row.interval_us = round(row.wanted_us / self.share) if stretched else row.wanted_us
        self._sent = [row for row in self._rows if row.interval_us != OFF]
        fast = any(row.interval_us < SLOT_US for row in self._sent)
        self.slot_us = self._tick_us if fast else SLOT_US  # how often to ask for what is due

    def _share(self) -> float:
        if self._max_bytes_s is None:
            return 1.0
        wanted = {True: 0.0, False: 0.0}  # bytes/s, of what is vital and of the rest
        for row in self._rows:
            if row.wanted_us != OFF:
                wanted[row.stream.vital] += 1e6 * row.size / row.wanted_us
        # What is vital is little; a line that has no room even for that has some for the rest.
        left = max(self._max_bytes_s - wanted[True], _MIN_SHARE * self._max_bytes_s)
        return min(left / wanted[False], 1.0) if wanted[False] > 0.0 else 1.0
