r"""Case I: known walls, as planes, against every critical point (eq 22).

.. math:: h_1 = S(n\cdot p_j - d_0 - s_{min}) + n\cdot v_j

for each wall with unit normal n into free space and each critical point j: base, joint 2,
end-effector. The paper multiplies a vector :math:`\alpha_{max}` with a direction, which can
be negative; here :math:`\alpha` is a scalar (docs/equations.md E22).
"""

from __future__ import annotations

import numpy as np

from fsw.barriers.robust import required_h
from fsw.barriers.root import BarrierNumbers, BarrierTuning, root, root_slope
from fsw.barriers.soft_rows import SoftRows, TargetPoints
from fsw.compiled import compiled
from fsw.model.linearisation import POINTS, Linearisation
from fsw.model.prediction import INPUTS, Array, CondensedModel
from fsw.signals import Wall


class WallBarrier:
    """Rows for walls x critical points x nodes, one slack a node and wall."""

    def __init__(
        self, walls: tuple[Wall, ...], tuning: BarrierTuning, model: CondensedModel
    ) -> None:
        self._tuning = tuning.numbers(model.period)
        self._normals = np.array([wall.normal for wall in walls]).reshape(-1, 3)
        self._offsets = np.array([wall.offset + wall.clearance for wall in walls])
        nodes = np.arange(1 + tuning.skipped_nodes, model.horizon + 1)
        node, wall, _ = np.meshgrid(nodes, np.arange(len(walls)), np.arange(POINTS), indexing="ij")
        slack = (node - nodes[0]) * len(walls) + wall
        self.rows = SoftRows(node.ravel(), slack.ravel(), INPUTS * model.horizon)
        self._h_start = np.zeros(len(walls) * POINTS)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise h of every wall, point and node."""
        rows = self.rows
        _fill(
            self._normals,
            self._offsets,
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
        """h at node 0 by wall and point [m/s]."""
        return self._h_start


@compiled
def _fill(
    normals: Array,
    offsets: Array,
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
    walls, nodes = normals.shape[0], position.shape[0]
    row = 0
    for i in range(nodes):
        if 0 < i < tuning.first_node:
            continue
        for wall in range(walls):
            nx, ny, nz = normals[wall]
            for point in range(POINTS):
                p, v = position[i, point], velocity[i, point]
                distance = nx * p[0] + ny * p[1] + nz * p[2] - offsets[wall]
                approach = nx * v[0] + ny * v[1] + nz * v[2]
                h = root(distance, tuning.alpha, tuning.slope) + approach
                if i == 0:
                    h_start[wall * POINTS + point] = h
                    continue
                steepness = root_slope(distance, tuning.alpha, tuning.slope)
                dp, dv = d_position[i, point], d_velocity[i, point]
                gradient_along(normals[wall], steepness, dp, dv, INPUTS * i, gradient[row])
                value[row] = h
                anchor = h_start[wall * POINTS + point]
                required[row] = required_h(anchor, i, tuning)
                row += 1


@compiled
def gradient_along(
    n: Array, steepness: float, dp: Array, dv: Array, columns: int, row: Array
) -> None:
    """Slope of ``S(n . p - c) + n . v`` in the inputs, into a row's first columns.

    Args:
        n: (3,), unit.
        steepness: Of S [1/s].
        dp: (3, inputs), of the point's position.
        dv: (3, inputs), of its velocity.
        columns: How many inputs come before the row's node.
        row: (inputs,), overwritten.
    """
    nx, ny, nz = n
    for column in range(columns):
        row[column] = (
            nx * (steepness * dp[0, column] + dv[0, column])
            + ny * (steepness * dp[1, column] + dv[1, column])
            + nz * (steepness * dp[2, column] + dv[2, column])
        )
