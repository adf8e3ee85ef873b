r"""The point-obstacle barrier of the paper's preliminaries (eqs 11 and 12).

.. math:: h_0 = S(\|p\| - d_s) + \hat p\cdot v

with p from the obstacle to the base. The direction is frozen at the guess, so that each row
is the tangent plane of the obstacle's ball; inside 2 mm of the obstacle any direction does.

Source: docs/equations.md E11, E12.
"""

from __future__ import annotations

import numpy as np

from fsw.barriers.robust import required_h
from fsw.barriers.root import BarrierTuning, root, root_slope
from fsw.barriers.soft_rows import SoftRows, TargetPoints, kinds_moving_base
from fsw.model.linearisation import BASE, Linearisation
from fsw.model.prediction import INPUTS, Array

_CENTRE_BALL = 0.002  # m


class PointObstacleBarrier:
    """Rows for one obstacle x nodes, one slack a node."""

    def __init__(
        self,
        position: tuple[float, float, float],
        clearance: float,
        tuning: BarrierTuning,
        horizon: int,
    ) -> None:
        self._tuning = tuning
        self._obstacle = np.array(position)
        self._clearance = clearance
        nodes = np.arange(1 + tuning.skipped_nodes, horizon + 1)
        moved_by = kinds_moving_base(np.ones((len(nodes), 3)))
        self.rows = SoftRows(nodes, nodes - nodes[0], moved_by, INPUTS * horizon)
        self._h_start = np.zeros(1)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise h0 at every node along the guess's ray from the obstacle."""
        tuning, rows = self._tuning, self.rows
        p_start = horizon.position[0, BASE] - self._obstacle
        v_start = horizon.velocity[0, BASE]
        self._h_start[0] = self._h(_ray(p_start), p_start, v_start)
        for row, i in enumerate(rows.node):
            p = horizon.position[i, BASE] - self._obstacle
            n = _ray(p)
            steepness = root_slope(float(n @ p) - self._clearance, tuning.alpha, tuning.slope)
            rows.value[row] = self._h(n, p, horizon.velocity[i, BASE])
            rows.gradient[row] = n @ (
                steepness * horizon.d_position[i, BASE] + horizon.d_velocity[i, BASE]
            )
            rows.required[row] = required_h(self._h(n, p_start, v_start), i, tuning.numbers)

    def at_start(self) -> Array:
        """h0 at node 0 [m/s], (1,)."""
        return self._h_start

    def _h(self, n: Array, p: Array, v: Array) -> float:
        tuning = self._tuning
        return root(float(n @ p) - self._clearance, tuning.alpha, tuning.slope) + float(n @ v)


def _ray(p: Array) -> Array:
    length = float(np.sqrt(p @ p))
    return p / length if length > _CENTRE_BALL else np.array([1.0, 0.0, 0.0])
