"""The newest events of the vehicle, which all links share, and how one link sends them."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, cast

from fsw.autopilot.signals import ArmingReport, Order, Severity, TickInputs, TickOutputs
from fsw.link.events.event_table import ARGUMENTS, Event, arming_events, failsafe_event
from fsw.link.services.service import LinkService
from fsw.link.text_limiter import REPEAT_US
from fsw.link.wire.decode import Numbers
from fsw.link.wire.outgoing import Outgoing
from messages import message_ids
from messages.frames import Frame
from messages.message_ids import AUTOPILOT, SYSTEM_ID

_ANNOUNCED_US: Final = 3_000_000  # between two announcements of the newest, as PX4
_MOST: Final = 32  # answers to one request: it must not take longer than a tick can wait
_RESET: Final = 1  # MAV_EVENT_CURRENT_SEQUENCE_FLAGS
_UNAVAILABLE: Final = 0  # MAV_EVENT_ERROR_REASON
_MS: Final = 0xFFFFFFFF
_KEPT: Final = 64  # events; a client that missed more is told so
_BETWEEN_US: Final = 2_000_000  # two reports of the arming checks that no client asked for
_SEQUENCE: Final = 0x10000


@dataclass(frozen=True, slots=True)
class NumberedEvent:
    """An event, when it was and which one in the sequence."""

    event: Event
    t_us: int
    sequence: int


class EventLog:
    """What has happened; ``observe`` is called with the outputs of every tick."""

    def __init__(self) -> None:
        self.newest = 0  # sequence number of the last event
        self._kept: deque[NumberedEvent] = deque(maxlen=_KEPT)
        self._reported: ArmingReport | None = None  # the last one that was sent
        self._reported_us: int | None = None
        self._lately: dict[Event, int] = {}  # when each was; there are as many as conditions

    def observe(self, inputs: TickInputs, outputs: TickOutputs) -> None:
        """Take in what a tick heard and says."""
        snapshot = outputs.snapshot
        report, last_us = snapshot.arming, self._reported_us
        if report is self._reported and not outputs.texts and not inputs.commands:
            return  # as on almost every tick
        for text in outputs.texts:
            if text.event is not None:
                self._add_failsafe(failsafe_event(text.event), snapshot.t_us)
        # A vehicle that is armed refuses to be checked.
        asked = not snapshot.armed and any(
            one.action is Order.CHECK_ARMING for one in inputs.commands
        )
        waits = last_us is not None and snapshot.t_us - last_us < _BETWEEN_US
        if not asked and (waits or report == self._reported):
            return
        self._reported, self._reported_us = report, snapshot.t_us
        for event in arming_events(report):
            self._add(event, snapshot.t_us)

    def after(self, sequence: int) -> tuple[NumberedEvent, ...]:
        """Events that came after a ``sequence`` number [1]."""
        missing = (self.newest - sequence) % _SEQUENCE
        return tuple(self._kept)[-missing:] if missing else ()

    def find(self, sequence: int) -> NumberedEvent | None:
        """The event of a ``sequence`` number [1], None if it is not kept any more."""
        at = (sequence - self.oldest) % _SEQUENCE
        return self._kept[at] if at < len(self._kept) else None

    @property
    def oldest(self) -> int:
        """Sequence number of the oldest event that is kept."""
        return self._kept[0].sequence if self._kept else self.newest

    def _add_failsafe(self, event: Event, t_us: int) -> None:
        """Add it, a minor one once in a while only: some conditions come and go."""
        last_us = self._lately.get(event)
        if event.severity > Severity.CRITICAL:
            if last_us is not None and t_us - last_us < REPEAT_US:
                return
            self._lately[event] = t_us
        self._add(event, t_us)

    def _add(self, event: Event, t_us: int) -> None:
        self.newest = (self.newest + 1) % _SEQUENCE
        self._kept.append(NumberedEvent(event, t_us, self.newest))


class EventService(LinkService):
    """Sends events to the peers of one link, and again those that a client has missed."""

    message_ids = frozenset({message_ids.REQUEST_EVENT})

    def __init__(self, log: EventLog) -> None:
        self._log = log
        self._sent = log.newest
        self._announced_us: int | None = None

    def handle(self, frame: Frame, t_us: int) -> Sequence[Outgoing]:
        """Send events again; say of each that is not kept any more which the oldest is."""
        first, last, system, component = cast(Numbers, frame.payload_values)
        if system != SYSTEM_ID or component not in (0, AUTOPILOT):
            return ()
        count = min((int(last) - int(first)) % _SEQUENCE + 1, _MOST)
        answers = []
        for k in range(count):
            sequence = (int(first) + k) % _SEQUENCE
            found = self._log.find(sequence)
            if found is not None:
                answers.append(_sent(found))
                continue
            asker = (frame.system_id, frame.component_id)
            values = (sequence, self._log.oldest, *asker, _UNAVAILABLE)
            answers.append(Outgoing(message_ids.RESPONSE_EVENT_ERROR, values))
        return answers

    def poll(self, t_us: int) -> Sequence[Outgoing]:
        """What is new, and now and then the sequence number of the newest."""
        log, announced_us = self._log, self._announced_us
        due = announced_us is None or not 0 <= t_us - announced_us < _ANNOUNCED_US
        if self._sent == log.newest and not due:
            return ()
        messages = [_sent(one) for one in log.after(self._sent)]
        self._sent = log.newest
        if due:
            # Where nothing has been sent yet, what a client knows is of an earlier start.
            flags = _RESET if announced_us is None else 0
            self._announced_us = t_us
            first = log.newest if not messages else (log.newest - len(messages)) % _SEQUENCE
            current = Outgoing(message_ids.CURRENT_EVENT_SEQUENCE, (first, flags))
            messages = [current, *messages]
        return messages


def _sent(one: NumberedEvent) -> Outgoing:
    """EVENT to everybody."""
    arguments = one.event.arguments.ljust(ARGUMENTS, b"\0")
    levels = one.event.severity << 4 | one.event.severity
    return Outgoing(
        message_ids.EVENT,
        (one.event.id, one.t_us // 1000 & _MS, one.sequence, 0, 0, levels, *arguments),
    )
