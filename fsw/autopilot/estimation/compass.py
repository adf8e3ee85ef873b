r"""The offset of a magnetometer: an error that stays, and turns with the vehicle.

What a calibration leaves of the vehicle's own field is no noise: no number of readings takes it
away. Taken for noise, it averaged out: the filter was sure of the heading to a tenth of a degree
while that was off by three. It is considered (Schmidt): not estimated, but its covariance X with
the filter's error is carried on, and with the offset's variance B and a heading's slope J over it

.. math:: S = H P H^T + 2 H X J^T + J B J^T + R, \qquad K = (P H^T + X J^T) / S,

.. math:: P^+ = P - K S K^T, \qquad X^+ = X - K (H X + J B).

Any other measurement corrects X by I - K H. So P is the covariance of the error, offset included.

Source: S. F. Schmidt, Application of State-Space Methods to Navigation Problems, Advances in
Control Systems 3 (1966) 293; docs/decisions/0030-an-estimate-of-the-present.md.
"""

from __future__ import annotations

import math
from typing import Any

from fsw.autopilot.estimation.error_state import ERRORS, FIELD, correct
from fsw.compiled import compilable


@compilable
def distance_with_offset(x: Any, offset: float) -> float:
    """Chi-square of a heading's residual; the ``offset`` [Gauss] is a deviation of each axis.

    Leaves behind what ``error_state.distance`` does.
    """
    M, X, H, J, W = x.covariance, x.with_offset, x.H, x.offset_slope, x.gain
    if not x.compass:
        for i in range(ERRORS):
            for j in range(FIELD):
                X[i, j] = 0.0
        x.compass = 1
    variance = x.variance[0]
    for j in range(FIELD):
        variance += offset * offset * J[j] * J[j]
    for i in range(ERRORS):
        straight, through = 0.0, 0.0
        for j in range(ERRORS):
            straight += M[i, j] * H[0, j]
        for j in range(FIELD):
            through += X[i, j] * J[j]
        W[i, 0] = straight + through
        variance += H[0, i] * (straight + 2.0 * through)
    x.factor[0, 0] = math.sqrt(variance)
    x.residual[0] /= x.factor[0, 0]
    return float(x.residual[0] * x.residual[0])


@compilable
def correct_with_offset(x: Any, offset: float) -> None:
    """Take in the heading that ``distance_with_offset`` has judged; ``offset`` [Gauss] as there."""
    correct(x, 1)
    for i in range(ERRORS):
        for j in range(FIELD):
            share = offset * offset * x.offset_slope[j] / x.factor[0, 0]
            x.with_offset[i, j] -= x.gain[i, 0] * share
