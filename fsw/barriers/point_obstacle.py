r"""Known points to keep away from, against every critical point (eqs 11 and 12).

.. math:: h_0 = S(\|p\| - d_s) + \hat p\cdot v

with p from the obstacle to a critical point: base, joint 2, end-effector. The direction is
frozen at the guess, node by node, so that each row is that of a wall: the tangent plane of the
obstacle's ball, which lies outside the ball wherever the optimum goes. Inside 2 mm of the
obstacle any direction does.

Source: docs/equations.md E11, E12.
"""

from __future__ import annotations

import math

import numpy as np

from fsw.barriers.robust import required_h
from fsw.barriers.root import BarrierNumbers, BarrierTuning, root, root_slope
from fsw.barriers.soft_rows import SoftRows, TargetPoints
from fsw.barriers.tangent import CENTRE_BALL
from fsw.barriers.wall import gradient_along
from fsw.compiled import compiled
from fsw.model.linearisation import POINTS, Linearisation
from fsw.model.prediction import INPUTS, Array, CondensedModel
from fsw.signals import PointObstacle


def vertical_shares(obstacles: tuple[PointObstacle, ...]) -> Array:
    """(obstacles,), 0 for an upright one, whose distance is level, and 1 for a point."""
    return np.array([0.0 if obstacle.upright else 1.0 for obstacle in obstacles])


class PointObstacleBarrier:
    """Rows for obstacles x critical points x nodes, one slack a node and obstacle."""

    def __init__(
        self, obstacles: tuple[PointObstacle, ...], tuning: BarrierTuning, model: CondensedModel
    ) -> None:
        self._tuning = tuning.numbers(model.period)
        self._centres = np.array([obstacle.position for obstacle in obstacles]).reshape(-1, 3)
        self._clearances = np.array([obstacle.clearance for obstacle in obstacles])
        self._verticals = vertical_shares(obstacles)
        count = len(obstacles)
        nodes = np.arange(1 + tuning.skipped_nodes, model.horizon + 1)
        node, number, _ = np.meshgrid(nodes, np.arange(count), np.arange(POINTS), indexing="ij")
        slack = (node - nodes[0]) * count + number
        self.rows = SoftRows(node.ravel(), slack.ravel(), INPUTS * model.horizon)
        self._h_start = np.zeros(count * POINTS)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise h0 of every obstacle, point and node along the guess's ray."""
        rows = self.rows
        _fill(
            self._centres,
            self._clearances,
            self._verticals,
            horizon.position,
            horizon.velocity,
            horizon.d_position,
            horizon.d_velocity,
            self._tuning,
            self._h_start,
            rows.value,
            rows.required,
            rows.gradient,
        )

    def at_start(self) -> Array:
        """h0 at node 0 by obstacle and point [m/s]."""
        return self._h_start


@compiled
def _fill(
    centres: Array,
    clearances: Array,
    verticals: Array,
    position: Array,
    velocity: Array,
    d_position: Array,
    d_velocity: Array,
    tuning: BarrierNumbers,
    h_start: Array,
    value: Array,
    required: Array,
    gradient: Array,
) -> None:
    n = np.zeros(3)
    row = 0
    for i in range(position.shape[0]):
        if 0 < i < tuning.first_node:
            continue
        for number in range(centres.shape[0]):
            centre, clearance = centres[number], clearances[number]
            for point in range(POINTS):
                _ray(centre, verticals[number], position[i, point], n)
                h, distance = _h_along(
                    n, centre, clearance, position[i, point], velocity[i, point], tuning
                )
                if i == 0:
                    h_start[number * POINTS + point] = h
                    continue
                steepness = root_slope(distance, tuning.alpha, tuning.slope)
                dp, dv = d_position[i, point], d_velocity[i, point]
                gradient_along(n, steepness, dp, dv, INPUTS * i, gradient[row])
                anchor, _ = _h_along(
                    n, centre, clearance, position[0, point], velocity[0, point], tuning
                )
                value[row] = h
                required[row] = required_h(anchor, i, tuning)
                row += 1


@compiled
def _ray(centre: Array, vertical: float, p: Array, n: Array) -> None:
    """Unit vector from the obstacle to a point, into ``n``; level where the obstacle is upright."""
    x, y, z = p[0] - centre[0], p[1] - centre[1], vertical * (p[2] - centre[2])
    length = math.sqrt(x * x + y * y + z * z)
    n[0], n[1], n[2] = 1.0, 0.0, 0.0
    if length > CENTRE_BALL:
        n[0], n[1], n[2] = x / length, y / length, z / length


@compiled
def _h_along(
    n: Array, centre: Array, clearance: float, p: Array, v: Array, tuning: BarrierNumbers
) -> tuple[float, float]:
    """h of the tangent plane at n [m/s], and the distance to it [m]."""
    distance = -clearance
    approach = 0.0
    for axis in range(3):
        distance += n[axis] * (p[axis] - centre[axis])
        approach += n[axis] * v[axis]
    return root(distance, tuning.alpha, tuning.slope) + approach, distance
