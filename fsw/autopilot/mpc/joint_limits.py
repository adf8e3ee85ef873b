"""Joint limits as soft rows: angles (Table I) and rates. A disturbed arm may be found outside."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from fsw.autopilot.barriers.constraint_block import block
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Q_ARM, QD_ARM, Array, CondensedModel
from fsw.autopilot.mpc.qp_data import InputLimits

_RATE_SHARE: Final = 0.6  # of what a joint can do; the rest is for the loops


class JointLimits:
    """Angles, sums of angles and rates of the joints within limits at every node.

    One slack a node, of as many rad as rad/s: where the arm is found outside, either may give way.
    """

    def __init__(self, model: CondensedModel, limits: InputLimits) -> None:
        bounded = _rows(model, limits)
        minus = -np.array([row for row, _ in bounded])  # (rows, states)
        self._minus = np.ascontiguousarray(minus.T)
        self.rows = block((len(bounded),), 1, model.horizon, model.inputs)
        self.rows.lower_bound[:] = np.tile([-bound for _, bound in bounded], model.horizon)
        self.rows.gradient[:] = (minus @ model.gamma[1:]).reshape(self.rows.gradient.shape)
        self._value = self.rows.value.reshape(model.horizon, -1)

    def refill(self, horizon: Linearisation) -> None:
        """Bring angles and rates up to date; the gradient never changes."""
        np.dot(horizon.states[1:], self._minus, out=self._value)


def _rows(model: CondensedModel, limits: InputLimits) -> list[tuple[Array, float]]:
    """Of a state what is to be at most how much: (states,) [1], and rad or rad/s."""
    airframe, rows = model.airframe, []
    for angle in airframe.angle_limits:
        row = np.zeros(model.states)
        row[Q_ARM::2] = angle.row
        rows += [(row, angle.high - limits.joint_margin)]
        rows += [(-row, -angle.low - limits.joint_margin)]
    for joint in range(airframe.bodies.joints):
        row = np.zeros(model.states)
        row[QD_ARM + 2 * joint] = 1.0
        rate = min(limits.joint_rate, _RATE_SHARE * airframe.joint_rate_max[joint])
        rows += [(row, rate), (-row, rate)]
    return [(row, bound) for row, bound in rows if bound < math.inf]
