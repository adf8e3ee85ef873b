"""What the operator is told when the clock could not be kept."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

WARN_US: Final = 10_000_000  # between two warnings, in the vehicle's time


@dataclass(frozen=True, slots=True)
class Slips:
    """Counts since start."""

    late: int = 0  # ticks that ended after the next release
    skipped: int = 0  # releases without a tick
    stale: int = 0  # ticks without a sensor frame of their own
    plans_late: int = 0


_WORDS: Final = {
    "late": "late",
    "skipped": "skipped",
    "stale": "without sensors",
    "plans_late": "plans late",
}


# In that time, of 5000 ticks and 100 plans: fewer are no matter for an operator. They are counted
# in LOOP_TIMING, MPC_STATUS, the log and the result all the same.
MATTERS: Final = Slips(late=50, skipped=50, stale=50, plans_late=5)


class SlipWarning:
    """Says what was added in the last ten seconds, as soon as it is so much that it matters."""

    def __init__(self) -> None:
        self._before = Slips()
        self._since_us: int | None = None  # when it was so
        self._told_us: int | None = None

    def sentence(self, now: Slips, t_us: int) -> str | None:
        """The warning, if there is something to say and it is time for it.

        Args:
            now: Counts so far.
            t_us: The vehicle's time.
        """
        if self._since_us is None:
            self._since_us = t_us
        added = {
            one.name: getattr(now, one.name) - getattr(self._before, one.name)
            for one in fields(Slips)
        }
        matters = any(count >= getattr(MATTERS, name) for name, count in added.items())
        if matters and (self._told_us is None or t_us - self._told_us >= WARN_US):
            self._before, self._since_us, self._told_us = now, t_us, t_us
            said = [f"{count} {_WORDS[name]}" for name, count in added.items() if count > 0]
            return "ticks: " + ", ".join(said)
        if not matters and t_us - self._since_us >= WARN_US:
            self._before, self._since_us = now, t_us
        return None
