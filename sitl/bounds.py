"""Allowed ranges, declared beside each scenario field and checked when a file is read."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Range:
    """Closed interval, optionally on a grid."""

    low: float
    high: float
    step: float | None = None
    or_endless: bool = False  # inf is allowed as well

    def refuses(self, value: float) -> bool:
        """True outside the range; NaN is outside."""
        if value == math.inf:
            return not self.or_endless
        if not (self.low <= value <= self.high):
            return True
        return self.step is not None and abs(value / self.step - round(value / self.step)) > 1e-9

    def __str__(self) -> str:
        grid = f" in steps of {self.step:g}" if self.step is not None else ""
        endless = " or inf" if self.or_endless else ""
        return f"{self.low:g} to {self.high:g}{grid}{endless}"


@dataclass(frozen=True, slots=True)
class Choices:
    """One of a few words."""

    words: tuple[str, ...]

    def __str__(self) -> str:
        return "one of " + ", ".join(f'"{word}"' for word in self.words)


def inside(
    low: float, high: float, step: float | None = None, *, or_endless: bool = False
) -> dict[str, object]:
    """Field metadata: a number, or every entry of a vector, within ``low`` … ``high``."""
    return {"range": Range(low, high, step, or_endless)}


def choices(*words: str) -> dict[str, object]:
    """Field metadata: one of ``words``."""
    return {"choices": Choices(words)}
