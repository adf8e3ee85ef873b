r"""The paper's costs (eqs 18, 20, 21) and an input cost, as one Gauss-Newton quadratic.

.. math:: \sum_i \|e_e\|^2_{W_1} + \|v_e - v_d\|^2_{W_2} + \|p_{G,x}\|^2_{W_3}
          + w_\psi(\psi - \psi_d)^2 + \|u_i\|^2_R

over nodes 1..n-1, with the terminal weights at node n (node 0 is measured and constant).

The paper penalises :math:`v_e` itself, which pulls a moving end-effector back; by default
the target's velocity is subtracted (docs/equations.md E20 gives both figures).

Source: docs/equations.md E18, E20, E21.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fsw.barriers.soft_rows import TargetPoints
from fsw.compiled import compiled
from fsw.model.linearisation import END_EFFECTOR, Linearisation
from fsw.model.prediction import INPUTS, Q_ARM, YAW, YAW_RATE, Array


@dataclass(frozen=True, slots=True)
class CostWeights:
    """Weights of Table II and ours for the inputs."""

    tracking: float = 10.0  # w_1
    tracking_terminal: float = 50.0  # w_s1
    velocity: float = 2.0  # w_2
    velocity_terminal: float = 10.0  # w_s2
    arm_cog: float = 1.0  # w_3
    arm_cog_terminal: float = 5.0  # w_s3
    # Ours: with base and arm both free to reach a point, nothing in the paper's cost says where
    # to look, and beside walls the vehicle wandered through half a turn.
    yaw: float = 0.05
    # Added to the yaw is what its rate makes of it in this time: the horizon is too short for the
    # planner to see that what turns must be stopped as well, and the vehicle swung for ever.
    yaw_lead: float = 2.0  # s
    posture: float = 2.0  # on joint angles that a ground station asks for
    inputs: float = 0.02  # on a_d, yaw and joint accelerations alike
    relative_velocity: bool = True  # v_e - v_d in eq 20 instead of the printed v_e


class Cost(Protocol):
    """Something the planner minimises, as a quadratic around a guess of the inputs."""

    def add(
        self,
        horizon: Linearisation,
        targets: TargetPoints,
        guess: Array,
        hessian: Array,
        gradient: Array,
    ) -> float:
        """Add ``1/2 U' hessian U + gradient' U`` of this cost.

        Args:
            horizon: Linearisation around ``guess``.
            targets: Reference at the nodes.
            guess: Inputs of the linearisation, (6 n,).
            hessian: (6 n, 6 n), upper triangle added to.
            gradient: (6 n,), added to.

        Returns:
            The cost at the guess.
        """
        ...


class TrackingCost:
    """Eqs 18, 20 and 21 and the inputs: what all of the paper's controllers minimise."""

    def __init__(self, weights: CostWeights) -> None:
        self._weights = np.array(
            (
                (weights.tracking, weights.velocity, weights.arm_cog),
                (weights.tracking_terminal, weights.velocity_terminal, weights.arm_cog_terminal),
            )
        )
        self._inputs = weights.inputs
        self._yaw = (weights.yaw, weights.yaw_lead)
        self._velocity_share = 1.0 if weights.relative_velocity else 0.0

    def add(
        self,
        horizon: Linearisation,
        targets: TargetPoints,
        guess: Array,
        hessian: Array,
        gradient: Array,
    ) -> float:
        """See ``Cost``."""
        return _add_tracking(
            self._weights,
            self._inputs,
            *self._yaw,
            self._velocity_share,
            horizon.states[:, YAW : YAW_RATE + 1],
            horizon.model.gamma[:, YAW : YAW_RATE + 1],
            targets.yaw,
            horizon.position[:, END_EFFECTOR],
            horizon.velocity[:, END_EFFECTOR],
            horizon.arm_cog,
            horizon.d_position[:, END_EFFECTOR],
            horizon.d_velocity[:, END_EFFECTOR],
            horizon.d_arm_cog,
            targets.position,
            targets.velocity,
            guess,
            hessian,
            gradient,
        )


class PostureCost:
    """Ours: joints that are asked for. Body and end-effector can then both be given."""

    def __init__(self, weights: CostWeights) -> None:
        self._weight = weights.posture

    def add(
        self,
        horizon: Linearisation,
        targets: TargetPoints,
        guess: Array,
        hessian: Array,
        gradient: Array,
    ) -> float:
        """See ``Cost``; nothing where no joints are asked for."""
        if targets.q_arm is None:
            return 0.0
        return _add_posture(
            self._weight,
            horizon.states[:, Q_ARM : Q_ARM + 2],
            horizon.model.gamma[:, Q_ARM : Q_ARM + 2],
            targets.q_arm,
            guess,
            hessian,
            gradient,
        )


@compiled
def _add_posture(
    weight: float,
    q_arm: Array,
    d_q_arm: Array,
    wanted: Array,
    guess: Array,
    hessian: Array,
    gradient: Array,
) -> float:
    cost = 0.0
    for i in range(1, q_arm.shape[0]):
        for joint in range(2):
            value = q_arm[i, joint] - wanted[i, joint]
            cost += weight * value * value
            row = d_q_arm[i, joint]
            add_square(weight, value, row, INPUTS * i, guess, hessian, gradient)
    return cost


@compiled
def add_square(
    weight: float,
    value: float,
    row: Array,
    columns: int,
    guess: Array,
    hessian: Array,
    gradient: Array,
) -> None:
    """Add ``weight (value + row (U - guess))^2`` over the first columns."""
    at_zero = value
    for k in range(columns):
        at_zero -= row[k] * guess[k]
    for k in range(columns):
        scaled = 2.0 * weight * row[k]
        if scaled != 0.0:
            gradient[k] += scaled * at_zero
            for m in range(k, columns):
                hessian[k, m] += scaled * row[m]


@compiled
def _add_tracking(
    weights: Array,
    input_weight: float,
    yaw_weight: float,
    yaw_lead: float,
    velocity_share: float,
    yaw: Array,
    d_yaw: Array,
    target_yaw: Array,
    position: Array,
    velocity: Array,
    cog: Array,
    d_position: Array,
    d_velocity: Array,
    d_cog: Array,
    target_position: Array,
    target_velocity: Array,
    guess: Array,
    hessian: Array,
    gradient: Array,
) -> float:
    n = position.shape[0] - 1
    cost = 0.0
    for k in range(INPUTS * n):
        hessian[k, k] += 2.0 * input_weight
        cost += input_weight * guess[k] * guess[k]
    rows, values, weight = np.zeros((8, INPUTS * n)), np.zeros(8), np.zeros(8)
    for i in range(1, n + 1):
        w = weights[1 if i == n else 0]
        rows[0:3], rows[3:6], rows[6] = d_position[i], d_velocity[i], d_cog[i]
        rows[7] = d_yaw[i, 0] + yaw_lead * d_yaw[i, 1]
        weight[0:3], weight[3:6], weight[6], weight[7] = w[0], w[1], w[2], yaw_weight
        values[0:3] = position[i] - target_position[i]
        values[3:6] = velocity[i] - velocity_share * target_velocity[i]
        values[6] = cog[i]
        # The short way round: a target half a turn away must not unwind whole turns.
        turn = (yaw[i, 0] - target_yaw[i] + math.pi) % (2.0 * math.pi) - math.pi
        values[7] = turn + yaw_lead * yaw[i, 1]
        _add_eight_squares(weight, values, rows, INPUTS * i, guess, hessian, gradient)
        for residual in range(8):
            cost += weight[residual] * values[residual] * values[residual]
    return cost


@compiled
def _add_eight_squares(
    weight: Array,
    value: Array,
    rows: Array,
    columns: int,
    guess: Array,
    hessian: Array,
    gradient: Array,
) -> None:
    """``add_square`` for all residuals of a node at once: the Hessian is walked through once."""
    s0, s1, s2, s3, s4, s5, s6, s7 = rows
    at_zero = value.copy()
    for residual in range(8):
        for k in range(columns):
            at_zero[residual] -= rows[residual, k] * guess[k]
    for k in range(columns):
        c0, c1 = 2.0 * weight[0] * s0[k], 2.0 * weight[1] * s1[k]
        c2, c3 = 2.0 * weight[2] * s2[k], 2.0 * weight[3] * s3[k]
        c4, c5 = 2.0 * weight[4] * s4[k], 2.0 * weight[5] * s5[k]
        c6, c7 = 2.0 * weight[6] * s6[k], 2.0 * weight[7] * s7[k]
        gradient[k] += (c0 * at_zero[0] + c1 * at_zero[1] + c2 * at_zero[2] + c3 * at_zero[3]) + (
            c4 * at_zero[4] + c5 * at_zero[5] + c6 * at_zero[6] + c7 * at_zero[7]
        )
        h = hessian[k]
        for m in range(k, columns):
            h[m] += (c0 * s0[m] + c1 * s1[m] + c2 * s2[m] + c3 * s3[m]) + (
                c4 * s4[m] + c5 * s5[m] + c6 * s6[m] + c7 * s7[m]
            )
