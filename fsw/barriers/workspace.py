r"""Case II: a sphere that follows the end-effector target and must contain the base (eq 23).

The paper's pair :math:`h_{2a}, h_{2b}` acts along the ray from the base to the centre. Its
printed root is of a negative number inside the sphere and its direction is undefined at the
centre. With e = p - O, w = v - v_t and r the radius, along any unit direction n

.. math:: h = S(r - n\cdot e) - n\cdot w

keeps the base on the inner side of the sphere's tangent plane at n. Six directions, plus
and minus an orthonormal frame whose first axis is the outward ray, contain the paper's pair
(:math:`n = \pm e/|e|`) and catch sideways motion; nothing divides by :math:`|e|`.

Source: docs/equations.md E23.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fsw.barriers.cbf_row import Plane, barrier_value, fill_row
from fsw.barriers.constraint_block import Rows, TargetPoints, surface_rows
from fsw.barriers.safe_approach import BarrierNumbers, BarrierTuning
from fsw.compiled import compiled, of_fixed_types
from fsw.geometry.vectors import dot
from fsw.model.linearisation import BASE, Linearisation, PointMotions
from fsw.model.prediction import Array, CondensedModel
from fsw.signals import WorkspaceSphere

DIRECTIONS = 6
_CENTRE_BALL = 0.002  # m; closer than this the outward ray is noise and any frame does


class _Centre(NamedTuple):
    position: Array  # (n + 1, 3) m
    velocity: Array  # (n + 1, 3) m/s
    radius: float  # m


class WorkspaceBarrier:
    """Rows for six directions x nodes, one slack a node."""

    def __init__(
        self, sphere: WorkspaceSphere, tuning: BarrierTuning, model: CondensedModel
    ) -> None:
        self._tuning = tuning.numbers(model.period)
        self._radius = sphere.radius
        self._offset = np.array(sphere.centre_from_target)
        first = 1 + tuning.skipped_nodes
        self.rows = surface_rows(1, DIRECTIONS, first, model.horizon, starts=1)
        self._rows, self._fill = self.rows.rows, of_fixed_types(_fill)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise h along six directions, frozen at the guess, at every node."""
        centre = _Centre(targets.position + self._offset, targets.velocity, self._radius)
        self._fill(centre, horizon.points, self._tuning, self._rows)


@compiled
def outward_frame(e: Array, frame: Array) -> None:
    """Orthonormal rows ``frame`` (3, 3) [1], the first along ``e`` (3,) [m, NED].

    ``e`` is the base from the sphere's centre; at the centre the first row is x.
    """
    length = math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    frame[0] = 0.0
    if length > _CENTRE_BALL:
        frame[0] = e / length
    else:
        frame[0, 0] = 1.0
    # The second axis starts from the world axis that is farthest from the first.
    seed = 0
    for axis in range(1, 3):
        if abs(frame[0, axis]) < abs(frame[0, seed]):
            seed = axis
    along = frame[0, seed]
    frame[1] = -along * frame[0]
    frame[1, seed] += 1.0
    frame[1] /= math.sqrt(1.0 - along * along)
    frame[2, 0] = frame[0, 1] * frame[1, 2] - frame[0, 2] * frame[1, 1]
    frame[2, 1] = frame[0, 2] * frame[1, 0] - frame[0, 0] * frame[1, 2]
    frame[2, 2] = frame[0, 0] * frame[1, 1] - frame[0, 1] * frame[1, 0]


@compiled
def _tangent_plane(n: Array, e: Array, w: Array, radius: float) -> Plane:
    """The sphere's tangent plane at n, with its normal towards the centre, and the base."""
    return Plane(-n, radius - dot(n, e), -dot(n, w))


@compiled
def _fill(
    centre: _Centre,
    points: PointMotions,
    tuning: BarrierNumbers,
    rows: Rows,
) -> None:
    frame, radius = np.zeros((3, 3)), centre.radius
    e_start = points.position[0, BASE] - centre.position[0]
    w_start = points.velocity[0, BASE] - centre.velocity[0]
    outward_frame(e_start, frame)
    rows.start[0] = min(
        barrier_value(_tangent_plane(frame[0], e_start, w_start, radius), tuning),
        barrier_value(_tangent_plane(-frame[0], e_start, w_start, radius), tuning),
    )
    row = 0
    for i in range(tuning.first_node, points.position.shape[0]):
        e = points.position[i, BASE] - centre.position[i]
        w = points.velocity[i, BASE] - centre.velocity[i]
        outward_frame(e, frame)
        gradients = (points.d_position[i, BASE], points.d_velocity[i, BASE])
        for direction in range(DIRECTIONS):
            n = frame[direction // 2] if direction % 2 == 0 else -frame[direction // 2]
            at_start = barrier_value(_tangent_plane(n, e_start, w_start, radius), tuning)
            plane = _tangent_plane(n, e, w, radius)
            fill_row(rows, row, i, plane, at_start, gradients, tuning)
            row += 1
