"""Vectors of a scenario, and which numbers they may have."""

from __future__ import annotations

import math
from typing import Final, TypeAlias

from command_line.ranges import Range

V3: TypeAlias = tuple[float, float, float]
V2: TypeAlias = tuple[float, float]

WORLD_M = 1000.0  # m: far beyond any flight here, close enough to reject slips of the unit

ROUNDED: Final = 0.05  # [1] by which the length of a normal may be off 1 by rounding; it is scaled
NORMAL: Final = Range(-1.0 - ROUNDED, 1.0 + ROUNDED)
UNIT: Final = 1e-6  # [1] by which it is off 1 without any rounding


def normal_problem(normal: V3) -> str | None:
    """Key, value and what is allowed, where a ``normal`` [1, NED] is no unit vector."""
    length = math.hypot(*normal)
    if abs(length - 1.0) <= UNIT:
        return None
    return f"normal = {list(normal)}: must have length 1, has {length:.6g}"
