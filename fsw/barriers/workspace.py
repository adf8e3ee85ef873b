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

import numpy as np

from fsw.barriers.robust import required_h
from fsw.barriers.root import BarrierNumbers, BarrierTuning, root, root_slope
from fsw.barriers.soft_rows import SoftRows, TargetPoints
from fsw.compiled import compiled
from fsw.model.linearisation import BASE, Linearisation
from fsw.model.prediction import INPUTS, Array, CondensedModel
from fsw.signals import WorkspaceSphere

DIRECTIONS = 6
_CENTRE_BALL = 0.002  # m; closer than this the outward ray is noise and any frame does


class WorkspaceBarrier:
    """Rows for six directions x nodes, one slack a node."""

    def __init__(
        self, sphere: WorkspaceSphere, tuning: BarrierTuning, model: CondensedModel
    ) -> None:
        self._tuning = tuning.numbers(model.period)
        self._radius = sphere.radius
        self._offset = np.array(sphere.centre_from_target)
        nodes = np.arange(1 + tuning.skipped_nodes, model.horizon + 1)
        node = np.repeat(nodes, DIRECTIONS)
        self.rows = SoftRows(node, node - nodes[0], INPUTS * model.horizon)
        self._h_start = np.zeros(1)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise h along six directions, frozen at the guess, at every node."""
        rows = self.rows
        _fill(
            self._radius,
            targets.position + self._offset,
            targets.velocity,
            horizon.position[:, BASE],
            horizon.velocity[:, BASE],
            horizon.d_position[:, BASE],
            horizon.d_velocity[:, BASE],
            self._tuning,
            self._h_start,
            rows.value,
            rows.required,
            rows.gradient,
        )

    def at_start(self) -> Array:
        """The smaller of h2a and h2b at node 0 [m/s], (1,)."""
        return self._h_start


@compiled
def outward_frame(e: Array, frame: Array) -> None:
    """Orthonormal rows, the first along e or, at the centre, along x.

    Args:
        e: (3,) m, base from the sphere's centre.
        frame: (3, 3), overwritten.
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
def _h_along(n: Array, e: Array, w: Array, radius: float, tuning: BarrierNumbers) -> float:
    gap = radius - (n[0] * e[0] + n[1] * e[1] + n[2] * e[2])
    outward_speed: float = n[0] * w[0] + n[1] * w[1] + n[2] * w[2]
    return root(gap, tuning.alpha, tuning.slope) - outward_speed


@compiled
def _fill(
    radius: float,
    centre: Array,
    centre_velocity: Array,
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
    frame = np.zeros((3, 3))
    e_start, w_start = position[0] - centre[0], velocity[0] - centre_velocity[0]
    outward_frame(e_start, frame)
    h_start[0] = min(
        _h_along(frame[0], e_start, w_start, radius, tuning),
        _h_along(-frame[0], e_start, w_start, radius, tuning),
    )
    row = 0
    for i in range(tuning.first_node, position.shape[0]):
        e, w = position[i] - centre[i], velocity[i] - centre_velocity[i]
        outward_frame(e, frame)
        for direction in range(DIRECTIONS):
            n = frame[direction // 2] if direction % 2 == 0 else -frame[direction // 2]
            gap = radius - (n[0] * e[0] + n[1] * e[1] + n[2] * e[2])
            steepness = root_slope(gap, tuning.alpha, tuning.slope)
            for column in range(INPUTS * i):
                moved = 0.0
                for axis in range(3):
                    moved -= n[axis] * (
                        steepness * d_position[i, axis, column] + d_velocity[i, axis, column]
                    )
                gradient[row, column] = moved
            value[row] = _h_along(n, e, w, radius, tuning)
            anchor = _h_along(n, e_start, w_start, radius, tuning)
            required[row] = required_h(anchor, i, tuning)
            row += 1
