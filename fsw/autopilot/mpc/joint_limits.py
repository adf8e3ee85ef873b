"""Joint limits as soft rows: angles (Table I) and rates. A disturbed arm may be found outside."""

from __future__ import annotations

import numpy as np

from fsw.autopilot.barriers.constraint_block import block
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Q_ARM, QD_ARM, Array, CondensedModel
from fsw.autopilot.mpc.qp_data import InputLimits
from fsw.compiled import kernel, machine_code

_ANGLES = np.array([[1.0, 0.0], [-1.0, 0.0], [1.0, 1.0], [-1.0, -1.0]])  # +-th1, +-(th1 + th2)
_RATES = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])  # of each joint
_ROWS = len(_ANGLES) + len(_RATES)  # of a node


class JointLimits:
    """Angles of the links and rates of the joints within limits at every node.

    One slack a node, of as many rad as rad/s: where the arm is found outside, either may give way.
    """

    def __init__(self, model: CondensedModel, limits: InputLimits) -> None:
        airframe, horizon = model.airframe, model.horizon
        self.rows = block((_ROWS,), 1, horizon)
        angle1 = airframe.joint1_limit - limits.joint_margin
        angle12 = airframe.joint12_limit - limits.joint_margin
        node = np.repeat([angle1, angle12, limits.joint_rate], [2, 2, len(_RATES)])
        self.rows.lower_bound[:] = np.tile(-node, horizon)
        angles = model.gamma[1:, Q_ARM : Q_ARM + 2]  # (n, 2, 6 n)
        rates = model.gamma[1:, QD_ARM : QD_ARM + 2]
        gradient = self.rows.gradient.reshape(horizon, _ROWS, -1)
        gradient[:, : len(_ANGLES)] = -np.einsum("lj,njk->nlk", _ANGLES, angles)
        gradient[:, len(_ANGLES) :] = -np.einsum("lj,njk->nlk", _RATES, rates)

    def refill(self, horizon: Linearisation) -> None:
        """Bring angles and rates up to date; the gradient never changes."""
        _fill(horizon.states, self.rows.value)


@kernel
def _fill_values(states: Array, value: Array) -> None:
    """Minus what each row bounds, node by node: the order of ``_ANGLES`` and ``_RATES``."""
    for i in range(1, states.shape[0]):
        row, th1, th2 = _ROWS * (i - 1), states[i, Q_ARM], states[i, Q_ARM + 1]
        value[row], value[row + 1] = -th1, th1
        value[row + 2], value[row + 3] = -(th1 + th2), th1 + th2
        for joint in range(2):
            rate = states[i, QD_ARM + joint]
            value[row + 4 + 2 * joint], value[row + 5 + 2 * joint] = -rate, rate


_fill = machine_code(_fill_values)
