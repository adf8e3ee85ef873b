"""Sends events to the peers of one link, and again those that a client has missed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, cast

from fsw.link.events.event_log import EventLog, NumberedEvent
from fsw.link.events.event_table import ARGUMENTS
from fsw.link.services.service import LinkService
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
_SEQUENCE: Final = 0x10000


class EventService(LinkService):
    """Serves one link from the shared log."""

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
