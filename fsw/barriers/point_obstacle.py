r"""Known points to keep away from, against every critical point (eqs 11 and 12).

.. math:: h_0 = S(\|p\| - d_s) + \hat p\cdot v

with p from the obstacle to a critical point: base, joint 2, end-effector. The direction is
frozen at the guess, node by node, so that each row is that of a wall: the tangent plane of the
obstacle's ball, which lies outside the ball wherever the optimum goes. Inside 2 mm of the
obstacle any direction does.

Source: docs/equations.md E11, E12.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fsw.barriers.cbf_row import Plane, barrier_value, fill_row
from fsw.barriers.constraint_block import Rows, TargetPoints, surface_rows
from fsw.barriers.safe_approach import BarrierNumbers, BarrierTuning
from fsw.barriers.tangent import CENTRE_BALL
from fsw.compiled import compiled, of_fixed_types
from fsw.geometry.vectors import dot, norm
from fsw.model.linearisation import POINTS, Linearisation, PointMotions
from fsw.model.prediction import Array, CondensedModel
from fsw.signals import PointObstacle


def vertical_shares(obstacles: tuple[PointObstacle, ...]) -> Array:
    """(obstacles,), 0 for an upright one, whose distance is level, and 1 for a point."""
    return np.array([0.0 if obstacle.upright else 1.0 for obstacle in obstacles])


class _Obstacles(NamedTuple):
    centres: Array  # (obstacles, 3) m
    clearances: Array  # (obstacles,) m
    verticals: Array  # (obstacles,) 0 for an upright one, 1 for a point


class PointObstacleBarrier:
    """Rows for obstacles x critical points x nodes, one slack a node and obstacle."""

    def __init__(
        self, obstacles: tuple[PointObstacle, ...], tuning: BarrierTuning, model: CondensedModel
    ) -> None:
        self._tuning = tuning.numbers(model.period)
        self._obstacles = _Obstacles(
            np.array([obstacle.position for obstacle in obstacles]).reshape(-1, 3),
            np.array([obstacle.clearance for obstacle in obstacles]),
            vertical_shares(obstacles),
        )
        first = 1 + tuning.skipped_nodes
        self.rows = surface_rows(len(obstacles), POINTS, first, model.horizon)
        self._rows, self._fill = self.rows.rows, of_fixed_types(_fill)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise h0 of every obstacle, point and node along the guess's ray."""
        self._fill(self._obstacles, horizon.points, self._tuning, self._rows)


@compiled
def _fill(
    obstacles: _Obstacles,
    points: PointMotions,
    tuning: BarrierNumbers,
    rows: Rows,
) -> None:
    n = np.zeros(3)
    row = 0
    for i in range(points.position.shape[0]):
        if 0 < i < tuning.first_node:
            continue
        for k in range(obstacles.centres.shape[0]):
            for point in range(POINTS):
                _ray(obstacles, k, points.position[i, point], n)
                plane = _tangent_plane(obstacles, k, points, i, point, n)
                if i == 0:
                    rows.start[k * POINTS + point] = barrier_value(plane, tuning)
                    continue
                at_start = barrier_value(_tangent_plane(obstacles, k, points, 0, point, n), tuning)
                gradients = (points.d_position[i, point], points.d_velocity[i, point])
                fill_row(rows, row, i, plane, at_start, gradients, tuning)
                row += 1


@compiled
def _ray(obstacles: _Obstacles, k: int, p: Array, n: Array) -> None:
    """Unit vector from an obstacle to a point, into ``n``; level where it is upright."""
    centre, vertical = obstacles.centres[k], obstacles.verticals[k]
    x, y, z = p[0] - centre[0], p[1] - centre[1], vertical * (p[2] - centre[2])
    length = norm((x, y, z))
    n[0], n[1], n[2] = 1.0, 0.0, 0.0
    if length > CENTRE_BALL:
        n[0], n[1], n[2] = x / length, y / length, z / length


@compiled
def _tangent_plane(
    obstacles: _Obstacles, k: int, points: PointMotions, node: int, point: int, n: Array
) -> Plane:
    """The plane with normal n that touches the obstacle's ball, and a point at a node."""
    p, centre = points.position[node, point], obstacles.centres[k]
    distance = -obstacles.clearances[k]
    for axis in range(3):
        distance += n[axis] * (p[axis] - centre[axis])
    return Plane(n, distance, dot(n, points.velocity[node, point]))
