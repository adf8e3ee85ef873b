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


class SlipWarning:
    """Says what has been added since it last spoke, at a limited rate."""

    def __init__(self) -> None:
        self._told = Slips()
        self._told_us = -WARN_US

    def sentence(self, now: Slips, t_us: int) -> str | None:
        """The warning, if there is something to say and it is time for it.

        Args:
            now: Counts so far.
            t_us: The vehicle's time.
        """
        if now == self._told or t_us - self._told_us < WARN_US:
            return None
        added = [
            f"{count} {_WORDS[one.name]}"
            for one in fields(Slips)
            if (count := getattr(now, one.name) - getattr(self._told, one.name)) > 0
        ]
        self._told, self._told_us = now, t_us
        return "ticks: " + ", ".join(added) if added else None
