"""Message schedule of one link, and the commands to the link that change it or ask for a message.

On a line that is too slow for what is wanted all intervals are stretched alike, but those of what
is vital. The commands are answered here and do not reach the tick, because each link keeps its own
rates.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

from fsw.autopilot.ports import Clock
from fsw.autopilot.signals import (
    CommandRequest,
    CommandResult,
    FlightSnapshot,
    Severity,
    StatusText,
)
from fsw.link.bounded_memory import renew
from fsw.link.services.service import LinkService
from fsw.link.telemetry.streams import Stream, messages_now
from fsw.link.wire import decode
from fsw.link.wire.encode_standard import command_ack
from fsw.link.wire.outgoing import Outgoing, ServiceOutput, TelemetryContext
from messages import message_ids
from messages.frames import Frame, whole_size

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
_GET_MESSAGE_INTERVAL: Final = 510  # MAV_CMD
_SET_MESSAGE_INTERVAL: Final = 511
_REQUEST_MESSAGE: Final = 512
# MAV_CMD: the message it asks for, and whether its param1 must be 1.
_REQUESTS: Final = {
    410: (message_ids.HOME_POSITION, False),  # GET_HOME_POSITION
    519: (message_ids.PROTOCOL_VERSION, True),  # REQUEST_PROTOCOL_VERSION
    520: (message_ids.AUTOPILOT_VERSION, True),  # REQUEST_AUTOPILOT_CAPABILITIES
}
_DECODERS: Final = {
    message_ids.COMMAND_LONG: decode.command_long,
    message_ids.COMMAND_INT: decode.command_int,
}

_Outcome = tuple[int, str, Sequence[Outgoing]]  # MAV_RESULT, reason, what follows the ACK


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


class LinkCommands:
    """Serves one link."""

    def __init__(
        self, rates: StreamRates, context: TelemetryContext, services: Sequence[LinkService] = ()
    ) -> None:
        """Carry out what changes the rates, and let ``services`` carry out what is theirs."""
        self._rates = rates
        self._context = context
        self._commanded = {command: service for service in services for command in service.commands}

    def handle(
        self, frame: Frame, t_us: int, snapshot: FlightSnapshot | None, asker: object = None
    ) -> Sequence[ServiceOutput] | None:
        """Carry out a command to the link: what to send, with a text where it was refused.

        None if the frame is something else. The snapshot is the newest, None before the first tick;
        ``asker`` is the peer, whose wish for a rate is kept beside those of others.
        """
        decoder = _DECODERS.get(frame.message_id)
        if decoder is None or not decode.for_this_vehicle(frame):
            return None
        request = decoder(frame)
        outcome = self._carry_out(request, t_us, snapshot, asker)
        if outcome is None:
            return None
        result, reason, messages = outcome
        reply = Outgoing(message_ids.COMMAND_ACK, command_ack(request.answer(result)))
        texts = [StatusText(Severity.INFO, reason, prompt=True)] if reason else []
        return (reply, *messages, *texts)

    def _carry_out(
        self, request: CommandRequest, t_us: int, snapshot: FlightSnapshot | None, asker: object
    ) -> _Outcome | None:
        message_id, second = _whole(request.params[0]), request.params[1]
        if request.command == _GET_MESSAGE_INTERVAL:
            if message_id is None:
                return CommandResult.DENIED, "message interval: param1 is not a message id", ()
            values = (self._rates.interval_us(message_id), message_id & 0xFFFF)
            return CommandResult.ACCEPTED, "", (Outgoing(message_ids.MESSAGE_INTERVAL, values),)
        if request.command == _SET_MESSAGE_INTERVAL:
            return self._set_interval(message_id, _whole(second), t_us, asker)
        if request.command == _REQUEST_MESSAGE:
            if message_id is None:
                return CommandResult.DENIED, "request message: param1 is not a message id", ()
            return self._now(message_id, second, snapshot)
        service = self._commanded.get(request.command)
        if service is not None:
            armed = snapshot is not None and snapshot.armed
            return *service.carry_out(request, t_us, armed), ()
        if request.command in _REQUESTS:  # the older commands, each of which asks for one message
            wanted, param1_is_1 = _REQUESTS[request.command]
            if param1_is_1 and request.params[0] != 1.0:
                return (
                    CommandResult.DENIED,
                    f"command {request.command}: param1 must be 1 to request it",
                    (),
                )
            return self._now(wanted, math.nan, snapshot)
        return None

    def _set_interval(
        self, message_id: int | None, interval: int | None, t_us: int, asker: object
    ) -> _Outcome:
        if message_id is None or interval is None:
            return (
                CommandResult.DENIED,
                "message interval: param1 is a message id, param2 a time in us",
                (),
            )
        if self._rates.interval_us(message_id) == UNKNOWN:
            return CommandResult.FAILED, "", ()
        refusal = self._rates.set_interval(message_id, interval, t_us, asker)
        if refusal:
            return CommandResult.DENIED, refusal, ()
        in_force = self._rates.interval_us(message_id)
        if in_force != OFF and (interval == OFF or 0 < in_force < interval):
            why = "it is vital, or others on this link listen and have not asked for less"
            return (
                CommandResult.ACCEPTED,
                f"message {message_id} comes every {in_force} us: {why}",
                (),
            )
        return CommandResult.ACCEPTED, "", ()

    def _now(self, message_id: int, which: float, snapshot: FlightSnapshot | None) -> _Outcome:
        if snapshot is None:
            return (
                CommandResult.TEMPORARILY_REJECTED,
                "the flight software has not run a tick yet",
                (),
            )
        messages = messages_now(message_id, which, snapshot, self._context)
        if messages is None:
            # No text: ground stations probe for cameras, gimbals and much else at every start.
            return CommandResult.DENIED, "", ()
        if not messages:
            return CommandResult.TEMPORARILY_REJECTED, f"message {message_id}: no data yet", ()
        return CommandResult.ACCEPTED, "", messages


def _whole(number: float) -> int | None:
    """A parameter as an integer of 32 bits; None for NaN, infinity and what is out of range."""
    return round(number) if abs(number) < 2**31 else None
