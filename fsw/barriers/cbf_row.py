r"""Forward invariance with disturbance rejection (eq 25), in sampled data.

:math:`\dot h + \gamma(h - \lambda) \ge 0` says that h may decay towards :math:`\lambda` no
faster than exponentially. Sampled and accumulated from the start of the horizon,

.. math:: h_i \ge \beta^i h_0 + (1 - \beta^i)\lambda, \qquad \beta = 1 - \gamma T .

The rows are anchored at :math:`h_0`. Chained row by row they would let the first, which the
lagging vehicle cannot move, excuse the others.

Source: docs/equations.md E10, E25.
"""

from __future__ import annotations

from typing import NamedTuple

from fsw.barriers.constraint_block import Rows
from fsw.barriers.safe_approach import BarrierNumbers, safe_approach_slope, safe_approach_speed
from fsw.compiled import compiled
from fsw.model.prediction import INPUTS, Array


class Plane(NamedTuple):
    """A half-space and how a point moves against it."""

    normal: Array  # (3,) unit, world, into the free side
    distance: float  # m, of the point, positive on the free side
    rate: float  # m/s, of the distance


@compiled
def barrier_value(plane: Plane, tuning: BarrierNumbers) -> float:
    """h of a point against a plane [m/s]."""
    return safe_approach_speed(plane.distance, tuning.alpha, tuning.slope) + plane.rate


@compiled
def cbf_lower_bound(h_start: float, node: int, tuning: BarrierNumbers) -> float:
    """Least h [m/s] allowed at a node, 1..n, where it is ``h_start`` [m/s] at node 0."""
    decay = (1.0 - tuning.gamma * tuning.period) ** node
    return decay * h_start + (1.0 - decay) * tuning.lambda_


@compiled
def fill_row(
    rows: Rows,
    row: int,
    node: int,
    plane: Plane,
    h_start: float,
    gradients: tuple[Array, Array],
    tuning: BarrierNumbers,
) -> None:
    """Write h of a point against a plane, its least value and its gradient in the inputs.

    The plane is that of the node, frozen at the guess; as many inputs act before it. ``h_start``
    [m/s] is h of the same point and normal at node 0; ``gradients`` are those of the point's
    position and velocity, (3, 6 n) each.
    """
    rows.value[row] = barrier_value(plane, tuning)
    rows.lower_bound[row] = cbf_lower_bound(h_start, node, tuning)
    steepness = safe_approach_slope(plane.distance, tuning.alpha, tuning.slope)
    d_position, d_velocity = gradients
    nx, ny, nz = plane.normal
    gradient = rows.gradient[row]
    for column in range(INPUTS * node):
        gradient[column] = (
            nx * (steepness * d_position[0, column] + d_velocity[0, column])
            + ny * (steepness * d_position[1, column] + d_velocity[1, column])
            + nz * (steepness * d_position[2, column] + d_velocity[2, column])
        )
