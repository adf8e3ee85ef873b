"""The optimal control problem of one safe set: everything that is built once and refilled."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from fsw.autopilot.barriers.constraint_block import ConstraintBlock, TargetPoints, block
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Q_ARM, QD_ARM, Array, CondensedModel
from fsw.autopilot.mpc.clarabel_solver import WholeSolver
from fsw.autopilot.mpc.costs import Quadratic
from fsw.autopilot.mpc.dual_solver import DualSolver
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.qp_data import InputLimits, QpData
from fsw.autopilot.mpc.solution import QpSolver, Solution
from fsw.autopilot.mpc.variants import parts_of
from fsw.autopilot.signals import SafeSet
from fsw.record import JOINTS

QP_SOLVERS: dict[str, Callable[[QpData], QpSolver]] = {"dual": DualSolver, "whole": WholeSolver}
_RATE_SHARE: Final = 0.6  # of what a joint can do; the rest is for the loops


class Ocp:
    """Costs, barrier and limits of one safe set in one program."""

    def __init__(self, config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> None:
        self._horizon = Linearisation(model)
        self._limits = JointLimits(model, config.limits)
        parts = parts_of(config, model, safe_set)
        self._costs, self._barriers = parts.costs, parts.barriers
        self.follows_zones = parts.follows_zones
        blocks: list[tuple[ConstraintBlock, float | None]] = [
            (self._limits.rows, config.joint_slack)
        ]
        blocks += [(barrier.rows, parts.slack) for barrier in parts.barriers]
        self.qp = QpData(config.horizon, model.inputs, config.limits, tuple(blocks))
        self._first_barrier_slack = self.qp.inputs + self._limits.rows.slacks
        self._solver = QP_SOLVERS[config.qp_solver](self.qp)

    def update(self, safe_set: SafeSet) -> None:
        """Take other numbers of a safe set of the same layout, whose zones moved."""
        for barrier in self._barriers:
            barrier.update(safe_set)

    def linearise(self, start: Array, guess: Array, targets: TargetPoints) -> None:
        """Refill it around ``guess`` (inputs n,) [SI] from ``start`` (states,) [SI]."""
        program = self.qp
        self._horizon.refill(start, guess, targets.pushes)
        program.hessian[:] = 0.0
        program.linear[:] = 0.0
        guess = np.ascontiguousarray(guess)
        quadratic = Quadratic(guess, program.hessian, program.linear)
        self.cost = sum(cost.add(self._horizon, targets, quadratic) for cost in self._costs)
        self._limits.refill(self._horizon)
        for barrier in self._barriers:
            barrier.refill(self._horizon, targets)
        program.refill(guess)
        self._guess = guess

    def solve(self) -> Solution:
        """Solve the program as last linearised."""
        return self._solver.solve(self._guess)

    def barrier_at_start(self) -> tuple[float, ...]:
        """h of each constraint at node 0 [m/s]."""
        return tuple(h for barrier in self._barriers for h in barrier.rows.start.tolist())

    def largest_barrier_slack(self, x: Array) -> float:
        """Largest slack of the barrier's rows in a solution ``x`` (unknowns,) [SI], [m/s]."""
        slacks = x[self._first_barrier_slack :]
        return float(slacks.max()) if len(slacks) else 0.0


class JointLimits:
    """Angles (Table I), sums of angles and rates of the joints within limits at every node.

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
    joints, angles = airframe.bodies.joints, airframe.angle_limits
    for k in range(angles.rows):
        row = np.zeros(model.states)
        row[Q_ARM::2] = angles.row[JOINTS * k : JOINTS * k + joints]
        rows += [(row, angles.high[k] - limits.joint_margin)]
        rows += [(-row, -angles.low[k] - limits.joint_margin)]
    for joint in range(joints):
        row = np.zeros(model.states)
        row[QD_ARM + 2 * joint] = 1.0
        rate = min(limits.joint_rate, _RATE_SHARE * airframe.joint_rate_max[joint])
        rows += [(row, rate), (-row, rate)]
    return [(row, bound) for row, bound in rows if bound < math.inf]
