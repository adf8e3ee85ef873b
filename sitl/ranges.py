"""Which numbers a key of a scenario may have."""

from __future__ import annotations

import math
from typing import Final, NamedTuple, TypeAlias

V3: TypeAlias = tuple[float, float, float]
V2: TypeAlias = tuple[float, float]

WORLD_M = 1000.0  # m: far beyond any flight here, close enough to reject slips of the unit


class Range(NamedTuple):
    """Closed interval of a number, or of every entry of a vector; optionally on a grid."""

    low: float
    high: float
    step: float | None = None
    or_inf: bool = False

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
        return f"{self.low:g} to {self.high:g}{grid}{' or inf' if self.or_inf else ''}"


ROUNDED: Final = 0.05  # [1] by which the length of a normal may be off 1 by rounding; it is scaled
NORMAL: Final = Range(-1.0 - ROUNDED, 1.0 + ROUNDED)
