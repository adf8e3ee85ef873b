"""The newest events of the vehicle, in a sequence that all links share."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from fsw.autopilot.signals import ArmingReport, Order, Severity, TickInputs, TickOutputs
from fsw.link.events.event_table import Event, arming_events, failsafe_event
from fsw.link.text_limiter import REPEAT_US

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
