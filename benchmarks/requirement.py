"""What a measurement must keep: a figure, its bound, and the lines that say so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TextIO


@dataclass(frozen=True, slots=True)
class Requirement:
    """One figure and the most that it may be."""

    name: str
    measured: float
    bound: float
    unit: str = ""

    @property
    def passed(self) -> bool:
        """NaN is beyond any bound."""
        return self.measured <= self.bound

    def as_json(self) -> dict[str, Any]:
        """The requirement as a file keeps it."""
        return {
            "name": self.name,
            "measured": self.measured,
            "bound": self.bound,
            "unit": self.unit,
            "pass": self.passed,
        }


def print_requirements(rows: Sequence[Requirement], console: TextIO) -> None:
    """One line each."""
    for row in rows:
        mark = "pass" if row.passed else "FAIL"
        text = f"{row.name:44} {row.measured:10.4g} <= {row.bound:<8.4g} {row.unit:4} {mark}"
        print(text, file=console)
