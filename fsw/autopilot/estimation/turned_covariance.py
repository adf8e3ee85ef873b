"""Six entries of a covariance along other axes, in one call: a planning period asks for several.

So small, and so seldom, a call of NumPy finds nothing of itself in the processor's caches: the
dozen that this would be took 60 us in flight.
"""

from __future__ import annotations

import numpy as np

from fsw.autopilot.estimation.error_state import Array
from fsw.autopilot.signals import Mat3
from fsw.compiled import kernel

Vec6 = tuple[float, float, float, float, float, float]
SAME_AXES: Mat3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_NOTHING: Vec6 = (0.0,) * 6


def turned_covariance(
    covariance: Array, at: tuple[int, int], turns: tuple[Mat3, Mat3], more: Vec6 = _NOTHING
) -> Array:
    """Covariance (6, 6) [SI] of two vectors of the error, each along axes turned by a matrix [1].

    They begin ``at`` these places of the ``covariance`` (n, n) [SI], which has ``more`` [SI] on its
    diagonal there.
    """
    found = np.empty((6, 6))
    _turn(covariance, at, turns, more, found)
    return found


@kernel
def _turn(M: Array, at: tuple[int, int], turns: tuple[Mat3, Mat3], more: Vec6, out: Array) -> None:
    for i in range(6):
        for j in range(6):
            left, right, total = turns[i // 3], turns[j // 3], 0.0
            for k in range(3):
                for m in range(3):
                    entry = M[at[i // 3] + k, at[j // 3] + m]
                    if i // 3 == j // 3 and k == m:
                        entry += more[3 * (i // 3) + k]
                    total += left[3 * (i % 3) + k] * entry * right[3 * (j % 3) + m]
            out[i, j] = total
