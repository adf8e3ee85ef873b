"""Limits the status texts of one link: repeated ones are counted, floods are cut.

What answers a command or tells of a change of mode is news even in the same words: it is sent at
once a few times, so that neither a second failsafe nor a second answer comes late, and a condition
that flaps cannot flood the link.

An operator reads a handful of texts, and a ground station speaks them. A program that repeats a
command that cannot be carried out, twice a second, must not bury the texts that matter. Nor may its
refusals use up the budget of a failsafe's text, which may be a warning only: see ``_has_room``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from fsw.autopilot.signals import FailsafeEvent, Severity, StatusText
from fsw.link.bounded_memory import renew

REPEAT_US: Final = 5_000_000  # the same text is sent once in this time
_MOST: Final = 32  # texts and budgets remembered
_RATE_PER_S: Final = 5  # texts of one budget, in the long run
_BURST: Final = 20
_PROMPT: Final = 4.0  # of the same prompt text in a burst, and one in REPEAT_US in the long run
_NUMBER: Final = re.compile(r"[-+]?\d+(\.\d+)?")


@dataclass(slots=True)
class _Sent:
    text: StatusText
    at_us: int
    held_back: int = 0
    left: float = _PROMPT  # of a burst, before this one


@dataclass(slots=True)
class _Budget:
    room: float = _BURST
    at_us: int = 0

    def charge(self, t_us: int) -> bool:
        """Whether there is room for one more text; it takes its place."""
        grown = self.room + 1e-6 * _RATE_PER_S * (t_us - self.at_us)
        self.room, self.at_us = min(grown, float(_BURST)), t_us
        if self.room < 1.0:
            return False
        self.room -= 1.0
        return True


class TextLimiter:
    """One link's."""

    def __init__(self) -> None:
        self._sent: dict[str, _Sent] = {}  # oldest first
        self._budgets: dict[str, _Budget] = {}  # the same
        # As many as the failsafe table has conditions and answers to them.
        self._failsafes: dict[FailsafeEvent, _Budget] = {}
        self._dropped = 0
        self._dropped_us = 0

    def admit(self, text: StatusText, t_us: int) -> StatusText | None:
        """The text if it is to be sent now; None if it is counted only."""
        before = self._sent.get(text.text)
        left = _PROMPT
        if before is not None:
            apart_us = t_us - before.at_us
            left = min(max(before.left - 1.0, 0.0) + apart_us / REPEAT_US, _PROMPT)
            if apart_us < REPEAT_US and not (text.prompt and left >= 1.0):
                before.held_back += 1
                return None
        if not self._has_room(text, t_us):
            self._dropped += 1
            self._dropped_us = t_us
            return None
        renew(self._sent, text.text, _Sent(text, t_us, left=left), _MOST)
        return _counted(before) if before is not None and before.held_back else text

    def overdue(self, t_us: int) -> Iterator[StatusText]:
        """What was held back and has not come again, as information; call it once a second."""
        for sent in self._sent.values():
            if sent.held_back and t_us - sent.at_us >= REPEAT_US:
                yield replace(_counted(sent), severity=Severity.INFO)
                sent.at_us, sent.held_back = t_us, 0
        if self._dropped and _RATE_PER_S * (t_us - self._dropped_us) >= 1_000_000:
            yield StatusText(Severity.WARNING, f"{self._dropped} more texts were left out")
            self._dropped = 0

    def _has_room(self, text: StatusText, t_us: int) -> bool:
        """Charge the text to its budget.

        Emergencies have no limit: only the vehicle itself raises them. The text of a failsafe
        shares a budget with those of the same condition and action, however severe it is. Other
        critical texts share one with those that differ in their numbers only, all others share
        one. So whatever a client provokes, the first text of a failsafe is sent.
        """
        if text.severity <= Severity.EMERGENCY:
            return True
        if text.event is not None:
            event = text.event._replace(delay_us=0)
            return self._failsafes.setdefault(event, _Budget()).charge(t_us)
        key = _NUMBER.sub("#", text.text) if text.severity <= Severity.CRITICAL else ""
        budget = self._budgets.get(key, _Budget())
        renew(self._budgets, key, budget, _MOST)
        return budget.charge(t_us)


def _counted(sent: _Sent) -> StatusText:
    times = "once" if sent.held_back == 1 else f"{sent.held_back} times"
    return replace(sent.text, text=f"{sent.text.text} (again, {times})")
