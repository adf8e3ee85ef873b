"""Any kind of shape for compiled code."""

from __future__ import annotations

import math

from numba import literal_unroll

from sitl.compiled import kernel
from sitl.plant.vector import V3, Array
from sitl.shapes import KINDS
from sitl.shapes.kind import Nearest

_NEAREST = tuple(kind.nearest for kind in KINDS)


@kernel
def nearest(kind: int, numbers: Array, p: V3) -> Nearest:
    """A point p [m, NED] against the shape of a kind with ``numbers`` (16,) [m, NED]."""
    at = Nearest(math.inf, 0.0, 0.0, 1.0)
    k = 0
    for of_kind in literal_unroll(_NEAREST):
        if k == kind:
            at = of_kind(numbers, p[0], p[1], p[2])
        k += 1  # noqa: SIM113 - numba unrolls no enumerate
    return at
