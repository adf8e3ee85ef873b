"""Which numbers a key of a file may have."""

from __future__ import annotations

import math
from typing import NamedTuple


class Range(NamedTuple):
    """Closed interval of a number, or of every entry of a vector; optionally on a grid."""

    low: float
    high: float
    step: float | None = None
    or_inf: bool = False
    unit: str = ""  # where a key's name does not end with it

    def contains(self, value: float) -> bool:
        """Whether a value [unit of the key] is in the range; NaN is not."""
        if not math.isfinite(value):
            return self.or_inf and value > 0.0
        on_grid = self.step is None or math.isclose(
            value / self.step, round(value / self.step), abs_tol=1e-9
        )
        return self.low <= value <= self.high and on_grid

    def __str__(self) -> str:
        grid = f" in steps of {self.step:g}" if self.step is not None else ""
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.low:g} to {self.high:g}{unit}{grid}{' or inf' if self.or_inf else ''}"
