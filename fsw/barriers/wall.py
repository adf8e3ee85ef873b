r"""Case I: known walls, as planes, against every critical point (eq 22).

.. math:: h_1 = S(n\cdot p_j - d_0 - s_{min}) + n\cdot v_j

for each wall with unit normal n into free space and each critical point j: base, joint 2,
end-effector. The paper multiplies a vector :math:`\alpha_{max}` with a direction, which can
be negative; here :math:`\alpha` is a scalar (docs/equations.md E22).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fsw.barriers.cbf_row import Plane, barrier_value, fill_row
from fsw.barriers.constraint_block import Rows, TargetPoints, surface_rows
from fsw.barriers.safe_approach import BarrierNumbers, BarrierTuning
from fsw.compiled import compiled, of_fixed_types
from fsw.geometry.vectors import dot
from fsw.model.linearisation import POINTS, Linearisation, PointMotions
from fsw.model.prediction import Array, CondensedModel
from fsw.signals import Wall


class _Walls(NamedTuple):
    normals: Array  # (walls, 3) unit, into the free side
    offsets: Array  # (walls,) m, with the clearance


class WallBarrier:
    """Rows for walls x critical points x nodes, one slack a node and wall."""

    def __init__(
        self, walls: tuple[Wall, ...], tuning: BarrierTuning, model: CondensedModel
    ) -> None:
        self._tuning = tuning.numbers(model.period)
        self._walls = _Walls(
            np.array([wall.normal for wall in walls]).reshape(-1, 3),
            np.array([wall.offset + wall.clearance for wall in walls]),
        )
        first = 1 + tuning.skipped_nodes
        self.rows = surface_rows(len(walls), POINTS, first, model.horizon)
        self._rows, self._fill = self.rows.rows, of_fixed_types(_fill)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise h of every wall, point and node."""
        self._fill(self._walls, horizon.points, self._tuning, self._rows)


@compiled
def _fill(
    walls: _Walls,
    points: PointMotions,
    tuning: BarrierNumbers,
    rows: Rows,
) -> None:
    row = 0
    for i in range(points.position.shape[0]):
        if 0 < i < tuning.first_node:
            continue
        for wall in range(walls.normals.shape[0]):
            normal = walls.normals[wall]
            for point in range(POINTS):
                p, v = points.position[i, point], points.velocity[i, point]
                plane = Plane(normal, dot(normal, p) - walls.offsets[wall], dot(normal, v))
                column = wall * POINTS + point
                if i == 0:
                    rows.start[column] = barrier_value(plane, tuning)
                    continue
                gradients = (points.d_position[i, point], points.d_velocity[i, point])
                fill_row(rows, row, i, plane, rows.start[column], gradients, tuning)
                row += 1
