r"""The paper's costs (eqs 18, 20, 21) and an input cost, as one Gauss-Newton quadratic.

.. math:: \sum_i \|e_e\|^2_{W_1} + \|v_e - v_d\|^2_{W_2} + \|p_{G,xy}\|^2_{W_3}
          + w_\psi(\psi - \psi_d)^2 + \|u_i\|^2_R

over nodes 1..n-1, with the terminal weights at node n (node 0 is measured and constant). The
arm's centre of mass counts ahead and to the right in the body; the paper's arm has no other way
than ahead.

The paper penalises :math:`v_e` itself, which pulls a moving end-effector back; by default
the target's velocity is subtracted (docs/equations.md E20 gives both figures).

Source: docs/equations.md E18, E20, E21.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple, Protocol, cast

import numpy as np

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.linearisation import Linearisation, Tracked
from fsw.autopilot.model.prediction import Q_ARM, QD_ARM, Array
from fsw.autopilot.signals import Vec4
from fsw.compiled import compilable, kernel, machine_code

Vec8 = tuple[float, float, float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class CostWeights:
    """Weights of Table II and ours for the inputs."""

    tracking: float = 10.0  # w_1
    tracking_terminal: float = 50.0  # w_s1
    velocity: float = 2.0  # w_2
    velocity_terminal: float = 10.0  # w_s2
    arm_com: float = 1.0  # w_3
    arm_com_terminal: float = 5.0  # w_s3
    # Ours: with base and arm both free to reach a point, nothing in the paper's cost says where
    # to look, and beside walls the vehicle wandered through half a turn.
    yaw: float = 0.05
    # Added to the yaw is what its rate makes of it in this time: the horizon is too short for the
    # planner to see that what turns must be stopped as well, and the vehicle swung for ever.
    yaw_lead: float = 2.0  # s
    posture: float = 2.0  # on joint angles that a ground station asks for
    # Ours, of an arm with more joints than two, which the costs above settle: towards the posture
    # to fly in, with what its rate makes of it, or joints that nothing asks for drift for ever.
    home: float = 0.02
    home_lead: float = 0.5  # s
    # The same of any arm where there is something to touch: there it has room both ways. What
    # leads the arm's centre of mass below the base is left out, which leads it there.
    home_to_touch: float = 0.1
    inputs: float = 0.02  # on a_d, yaw and joint accelerations alike
    relative_velocity: bool = True  # v_e - v_d in eq 20 instead of the printed v_e

    @property
    def scale(self) -> float:
        """How many times as large as by default the largest of the weights is [1], 1 at least.

        Slacks cost as many times as much: what has to be kept outweighs what is wanted, whatever
        that weighs.
        """
        weights = [one for one in fields(self) if not one.name.endswith(("_lead", "_velocity"))]
        larger = [getattr(self, one.name) / cast(float, one.default) for one in weights]
        return float(max(1.0, *larger))


class Quadratic(NamedTuple):
    """``1/2 U' hessian U + gradient' U``, refilled in place."""

    guess: Array  # (inputs n,) of the linearisation
    hessian: Array  # (inputs n, inputs n), upper triangle
    gradient: Array  # (inputs n,)


class Cost(Protocol):
    """Something the planner minimises, as a quadratic around a guess of the inputs."""

    def add(self, horizon: Linearisation, targets: TargetPoints, quadratic: Quadratic) -> float:
        """Add this cost, around ``quadratic.guess``; returns the cost at the guess."""
        ...


class _TrackingWeights(NamedTuple):
    node: Array  # (2, 3): running and terminal; position, velocity, centre of mass
    inputs: float
    yaw: float
    yaw_lead: float  # s
    target_velocity: float  # share of the target's velocity that is subtracted, 0 or 1


class _Target(NamedTuple):
    yaw: Array  # (n + 1,) rad
    position: Array  # (n + 1, 3) m
    velocity: Array  # (n + 1, 3) m/s


class TrackingCost:
    """Eqs 18, 20 and 21 and the inputs: what all of the paper's controllers minimise."""

    def __init__(self, weights: CostWeights) -> None:
        self._weights = _TrackingWeights(
            node=np.array(
                (
                    (weights.tracking, weights.velocity, weights.arm_com),
                    (
                        weights.tracking_terminal,
                        weights.velocity_terminal,
                        weights.arm_com_terminal,
                    ),
                )
            ),
            inputs=weights.inputs,
            yaw=weights.yaw,
            yaw_lead=weights.yaw_lead,
            target_velocity=1.0 if weights.relative_velocity else 0.0,
        )
        self._add_tracking = machine_code(_add_tracking)

    def add(self, horizon: Linearisation, targets: TargetPoints, quadratic: Quadratic) -> float:
        """See ``Cost``."""
        target = _Target(targets.yaw, targets.position, targets.velocity)
        cost = self._add_tracking(self._weights, horizon.tracked, target, quadratic)
        if targets.pushes is not None:  # what holds against them costs nothing
            of_push = quadratic.gradient.reshape(len(targets.pushes), -1)[:, :3]
            of_push += 2.0 * self._weights.inputs * targets.pushes
        return cost


_SETTLED = 2  # joints, by what the paper's costs say


class PostureCost:
    """Ours: joints that are asked for. Body and end-effector can then both be given.

    Where none are, an arm that has more joints than are settled is led to its home posture.
    """

    def __init__(self, weights: CostWeights, airframe: Airframe, *, touches: bool = False) -> None:
        """For a vehicle of this ``airframe``, which may touch something or not."""
        joints = airframe.bodies.joints
        self._weights, self._home = weights, np.array([airframe.home])
        self._redundant = touches or joints > _SETTLED
        self._home_weight = weights.home_to_touch if touches else weights.home

    def add(self, horizon: Linearisation, targets: TargetPoints, quadratic: Quadratic) -> float:
        """See ``Cost``; nothing where no joints are asked for and none are redundant."""
        weight, lead, wanted = self._weights.posture, 0.0, targets.q_arm
        if wanted is None:
            if not self._redundant:
                return 0.0
            weight, lead = self._home_weight, self._weights.home_lead
            wanted = self._home.repeat(len(horizon.states), axis=0)
        return _add_posture(
            weight, lead, horizon.model.inputs, horizon.states, horizon.model.gamma, wanted,
            horizon.tracked.gradients[0], quadratic,
        )  # fmt: skip


@kernel
def _add_posture(
    weight: float,
    lead: float,
    inputs: int,
    states: Array,
    gamma: Array,
    targets: Array,
    row: Array,
    quadratic: Quadratic,
) -> float:
    cost = 0.0
    for i in range(1, states.shape[0]):
        for joint in range(targets.shape[1]):
            q, qd = Q_ARM + 2 * joint, QD_ARM + 2 * joint
            value = states[i, q] - targets[i, joint] + lead * states[i, qd]
            cost += weight * value * value
            for k in range(inputs * i):
                row[k] = gamma[i, q, k] + lead * gamma[i, qd, k]
            add_square(weight, value, row, inputs * i, quadratic)
    return cost


@kernel
def add_square(weight: float, value: float, row: Array, columns: int, quadratic: Quadratic) -> None:
    """Add ``weight`` [1 / unit of value^2] times ``(value + row (U - guess))^2``.

    ``value`` [any unit] is the residual at the guess and ``row`` (inputs n,) [value / input] its
    gradient, of which only the first ``columns`` count.
    """
    guess, hessian, gradient = quadratic
    at_zero = value
    for k in range(columns):
        at_zero -= row[k] * guess[k]
    for k in range(columns):
        scaled = 2.0 * weight * row[k]
        if scaled != 0.0:
            gradient[k] += scaled * at_zero
            for m in range(k, columns):
                hessian[k, m] += scaled * row[m]


@kernel
def _add_tracking(
    weights: _TrackingWeights, tracked: Tracked, target: _Target, quadratic: Quadratic
) -> float:
    guess, hessian, rows = quadratic.guess, quadratic.hessian, tracked.gradients
    n = tracked.position.shape[0] - 1
    inputs = len(guess) // n
    cost = 0.0
    for k in range(len(guess)):
        hessian[k, k] += 2.0 * weights.inputs
        cost += weights.inputs * guess[k] * guess[k]
    for i in range(1, n + 1):
        w = weights.node[1 if i == n else 0]
        # Entry by entry: for a slice numba compiles a text that says which shapes do not fit.
        for k in range(inputs * i):
            for axis in range(3):
                rows[axis, k] = tracked.d_position[i, axis, k]
                rows[3 + axis, k] = tracked.d_velocity[i, axis, k]
            for axis in range(2):
                rows[6 + axis, k] = tracked.d_arm_com[i, axis, k]
            rows[8, k] = tracked.d_yaw[i, 0, k] + weights.yaw_lead * tracked.d_yaw[i, 1, k]
        weight = (w[0], w[0], w[0], w[1], w[1], w[1], w[2], w[2])
        values = _compared(weights, tracked, target, i)
        _add_squares(weight, values, rows, inputs * i, quadratic)
        for residual in range(len(weight)):
            cost += weight[residual] * values[residual] * values[residual]
        # The short way round: a target half a turn away must not unwind whole turns.
        turn = (tracked.yaw[i, 0] - target.yaw[i] + math.pi) % (2.0 * math.pi) - math.pi
        turn += weights.yaw_lead * tracked.yaw[i, 1]
        cost += weights.yaw * turn * turn
        add_square(weights.yaw, turn, rows[8], inputs * i, quadratic)
    return cost


@compilable
def _compared(weights: _TrackingWeights, tracked: Tracked, target: _Target, i: int) -> Vec8:
    """How far a node's end-effector, its velocity and the centre of mass are from what is asked."""
    p, v, com, share = tracked.position, tracked.velocity, tracked.arm_com, weights.target_velocity
    return (
        p[i, 0] - target.position[i, 0],
        p[i, 1] - target.position[i, 1],
        p[i, 2] - target.position[i, 2],
        v[i, 0] - share * target.velocity[i, 0],
        v[i, 1] - share * target.velocity[i, 1],
        v[i, 2] - share * target.velocity[i, 2],
        com[i, 0],
        com[i, 1],
    )


@compilable
def _add_squares(
    weight: Vec8, value: Vec8, rows: Array, columns: int, quadratic: Quadratic
) -> None:
    """``add_square`` for all residuals of a node at once: the Hessian is walked through once."""
    guess, hessian, gradient = quadratic
    at_zero = _at_zero(value, rows, 0, columns, guess)
    others = _at_zero(value, rows, 4, columns, guess)
    for k in range(columns):
        a, b = _scaled(weight, rows, 0, k), _scaled(weight, rows, 4, k)
        gradient[k] += _sum4(a, at_zero) + _sum4(b, others)
        h = hessian[k]
        for m in range(k, columns):
            # Two sums of four, which a processor computes side by side.
            h[m] += _sum4(a, _column(rows, 0, m)) + _sum4(b, _column(rows, 4, m))


@compilable
def _at_zero(value: Vec8, rows: Array, r: int, columns: int, guess: Array) -> Vec4:
    """Four residuals where all inputs are 0, by their gradients."""
    a, b, c, d = value[r], value[r + 1], value[r + 2], value[r + 3]
    for k in range(columns):
        a -= rows[r, k] * guess[k]
        b -= rows[r + 1, k] * guess[k]
        c -= rows[r + 2, k] * guess[k]
        d -= rows[r + 3, k] * guess[k]
    return a, b, c, d


@compilable
def _scaled(weight: Vec8, rows: Array, r: int, k: int) -> Vec4:
    """Twice the weighted derivative of four residuals in one input."""
    return (
        2.0 * weight[r] * rows[r, k],
        2.0 * weight[r + 1] * rows[r + 1, k],
        2.0 * weight[r + 2] * rows[r + 2, k],
        2.0 * weight[r + 3] * rows[r + 3, k],
    )


@compilable
def _column(rows: Array, r: int, k: int) -> Vec4:
    return rows[r, k], rows[r + 1, k], rows[r + 2, k], rows[r + 3, k]


@compilable
def _sum4(a: Vec4, b: Vec4) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
