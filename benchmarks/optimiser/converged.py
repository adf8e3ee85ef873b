"""What a plan is worth: its cost on the nonlinear problem, whichever method found it."""

from __future__ import annotations

import numpy as np

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.prediction import Array, condense, to_vector
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.signals import PlanRequest, SafeSet
from studies.flight.slsqp_solver import min_slacks

_MAX_ITERATIONS = 60
_STAYS = 1e-7  # m/s^2 and rad/s^2


class ConvergedOcp:
    """Cost of given inputs, and the converged solution of a request."""

    def __init__(self, config: PlannerConfig, airframe: Airframe, safe_set: SafeSet) -> None:
        self._ocp = Ocp(config, condense(airframe, config.period, config.horizon), safe_set)
        self._unknowns = self._ocp.qp.inputs

    def cost(self, request: PlanRequest, inputs: Array) -> float:
        """Cost of ``inputs`` (6 n,) [m/s^2, rad/s^2] with the smallest slacks that admit them."""
        ocp = self._ocp
        ocp.linearise(to_vector(request.start), inputs, target_points(request))
        program = ocp.qp
        return float(ocp.cost + program.penalty @ min_slacks(program, inputs))

    def solve(self, request: PlanRequest, guess: Array) -> tuple[Array, float]:
        """Inputs and cost after programs from ``guess`` (6 n,) [m/s^2, rad/s^2] until they stay.

        Where they keep on changing (the directions of eq 23 turn with the iterate) the best
        that was met counts.
        """
        start, targets = to_vector(request.start), target_points(request)
        inputs, best = guess, (guess, self.cost(request, guess))
        for _ in range(_MAX_ITERATIONS):
            self._ocp.linearise(start, inputs, targets)
            solution = self._ocp.solve()
            if not solution.usable:
                break
            step = solution.x[: self._unknowns] - inputs
            inputs = solution.x[: self._unknowns]
            cost = self.cost(request, inputs)
            best = min(best, (inputs, cost), key=lambda known: known[1])
            if np.abs(step).max() < _STAYS:
                return inputs, cost
        return best


def target_points(request: PlanRequest) -> TargetPoints:
    """The reference at the nodes as arrays."""
    return TargetPoints(
        np.array([target.p_WE for target in request.targets]),
        np.array([target.v_WE for target in request.targets]),
        np.array([target.yaw for target in request.targets]),
    )
