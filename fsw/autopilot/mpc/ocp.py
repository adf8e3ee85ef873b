"""The optimal control problem of one safe set: everything that is built once and refilled.

``by_programs`` in ``optimisers.py`` calls ``linearise`` and ``solve`` in turn.
"""

from __future__ import annotations

import numpy as np

from fsw.autopilot.barriers.constraint_block import ConstraintBlock, TargetPoints
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array, CondensedModel
from fsw.autopilot.mpc.costs import Quadratic
from fsw.autopilot.mpc.dual_solver import DualSolver
from fsw.autopilot.mpc.joint_limits import JointLimits
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.qp_data import QpData, QpSolver, Solution
from fsw.autopilot.mpc.variants import parts_of
from fsw.autopilot.signals import SafeSet


class Ocp:
    """Costs, barrier and limits of one safe set in one program."""

    def __init__(self, config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> None:
        self._horizon = Linearisation(model)
        self._limits = JointLimits(model, config.limits)
        parts = parts_of(config, model, safe_set)
        self._costs, self._barriers = parts.costs, parts.barriers
        self.follows_zones = parts.follows_zones
        blocks: list[tuple[ConstraintBlock, float | None]] = [
            (self._limits.rows, config.weights.scale * config.joint_slack)
        ]
        blocks += [(barrier.rows, parts.slack) for barrier in parts.barriers]
        self.qp = QpData(config.horizon, model.inputs, config.limits, tuple(blocks))
        self._first_barrier_slack = self.qp.inputs + self._limits.rows.slacks
        self._solver: QpSolver = DualSolver(self.qp)

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
