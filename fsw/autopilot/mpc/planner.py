"""One planning cycle: from a request to a plan, or the reason for none.

Between the two is an optimiser: ``by_programs`` in ``optimisers.py`` linearises, refills and
solves, twice.

Source: docs/equations.md E17.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.barriers.zone_rows import layout
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.nominal import rest_state
from fsw.autopilot.model.prediction import QDD_ARM, YAW_ACC, Array, condense, to_vector
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.optimisers import OPTIMISERS, Question, Search
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.mpc.variants import VARIANTS
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import (
    Plan,
    PlanFailure,
    PlanInput,
    PlanRequest,
    PlanTimings,
    SafeSet,
    SolverStatus,
)
from fsw.autopilot.tuning import Tuning, tuned


class Planner:
    """The MPC of eq 17, solved by sequential quadratic programming.

    Holds the last solution as the next guess and the program of the current safe set and
    tuning; everything else comes with the request.
    """

    def __init__(
        self, config: PlannerConfig, airframe: Airframe, stopwatch_us: Callable[[], float]
    ) -> None:
        """Build the prediction model; ``stopwatch_us`` is for the reported stage times only.

        Raises:
            ValueError: The controller or the solver is one of a study that is not imported.
        """
        for name, known in ((config.controller, VARIANTS), (config.solver, OPTIMISERS)):
            if name not in known:
                raise ValueError(f"{name} is flown for comparison; start it with pandion")
        self._untuned = self._config = config
        self._tuning: Tuning = ()
        self._stopwatch_us = stopwatch_us
        self._period_us = config.period_us
        self._model = condense(airframe, config.period, config.horizon)
        self._safe_set: SafeSet | None = None
        self._ocp: Ocp | None = None
        self._joints = airframe.bodies.joints
        self._inputs: Array = np.zeros(self._model.inputs * config.horizon)
        self._t_us = 0

    def warm_up(self) -> None:
        """Compile every kernel and load the solver, before anything flies."""
        rest = rest_state(self._joints)._replace(p=(0.0, 0.0, -1.0))
        targets = (still_at((0.0, 0.0, -0.7)),) * (self._config.horizon + 1)
        near = wall((-1.0, 0.0, 0.0), 0.0, 0.1)  # too close: rows bind
        for safe_set in (SafeSet(), SafeSet((near, target_sphere((0.0, 0.0, -0.3), 0.1)))):
            for joint_targets in ((), (rest.q_arm,) * len(targets)):
                self.plan(
                    PlanRequest(
                        plan_id=0,
                        t_apply_us=0,
                        start=rest,
                        targets=targets,
                        safe_set=safe_set,
                        from_nominal=False,
                        joint_targets=joint_targets,
                    )
                )
        self._inputs[:] = 0.0

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        """Answer one request.

        Returns:
            A plan whose every program was solved, or a failure that says which was not.
        """
        begin = self._stopwatch_us()
        start = to_vector(request.start)
        refusal = self._refusal(request, start)
        if refusal is not None:
            return PlanFailure(
                request.plan_id, SolverStatus.INPUT_REFUSED, refusal, PlanTimings(0.0, 0.0, 0.0)
            )
        if request.tuning != self._tuning:
            self._retune(request.tuning)
        ocp = self._ocp_for(request.safe_set)
        targets = TargetPoints(
            np.array([target.p_WE for target in request.targets]),
            np.array([target.v_WE for target in request.targets]),
            np.array([target.yaw for target in request.targets]),
            np.array(request.joint_targets) if request.joint_targets else None,
            request.t_apply_us,
            request.recent_disturbance,
            np.array(request.pushes) if request.pushes else None,
        )
        asked = Question(ocp, start, targets, self._guess(request.t_apply_us))
        search = OPTIMISERS[self._config.solver](asked, self._config, self._stopwatch_us)
        solution = search.solution
        if not solution.usable:
            timings = _timings(search, self._stopwatch_us() - begin)
            return PlanFailure(request.plan_id, solution.status, "", timings)
        inputs = solution.x[: len(self._inputs)]
        self._inputs = inputs
        self._t_us = request.t_apply_us
        return Plan(
            plan_id=request.plan_id,
            t_us=request.t_apply_us,
            period_us=self._period_us,
            start=request.start,
            inputs=_as_plan_inputs(inputs.reshape(-1, self._model.inputs), request),
            status=solution.status,
            cost=ocp.cost,
            slack_max=ocp.largest_barrier_slack(solution.x),
            barrier=ocp.barrier_at_start(),
            sqp_iterations=search.sqp_iterations,
            solver_iterations=search.solver_iterations,
            timings=_timings(search, self._stopwatch_us() - begin),
        )

    def _refusal(self, request: PlanRequest, start: Array) -> str | None:
        if len(request.targets) != self._config.horizon + 1:
            return f"{len(request.targets)} targets given, {self._config.horizon + 1} needed"
        # What is not finite stays so in a sum.
        if not math.isfinite(sum(start.tolist())):
            return "the start state is not finite"
        if not math.isfinite(
            sum([sum(one.p_WE) + sum(one.v_WE) + one.yaw for one in request.targets])
        ):
            return "a target is not finite"
        if len(request.joint_targets) not in (0, len(request.targets)):
            return (
                f"{len(request.joint_targets)} joint targets given for {len(request.targets)} nodes"
            )
        if not math.isfinite(sum(map(sum, request.joint_targets))):
            return "a joint target is not finite"
        given, finite = len(request.pushes), math.isfinite(sum(map(sum, request.pushes)))
        if given not in (0, self._config.horizon) or not finite:
            return f"{given} pushes for {self._config.horizon} steps, or one is not finite"
        return None

    def _retune(self, tuning: Tuning) -> None:
        self._config = tuned(self._untuned, tuning)
        self._tuning = tuning
        self._ocp = None

    def _ocp_for(self, safe_set: SafeSet) -> Ocp:
        """The program of a safe set, built anew only where its rows are others."""
        if self._ocp is not None and safe_set == self._safe_set:
            return self._ocp
        known = None if self._safe_set is None else layout(self._safe_set)
        self._safe_set = safe_set
        if self._ocp is None or layout(safe_set) != known or not self._ocp.follows_zones:
            self._ocp = Ocp(self._config, self._model, safe_set)
        else:
            self._ocp.update(safe_set)
        return self._ocp

    def _guess(self, t_us: int) -> Array:
        """The last solution moved on by one period, or rest after a break."""
        if t_us - self._t_us != self._period_us:
            return np.zeros_like(self._inputs)
        node = self._model.inputs
        return np.concatenate((self._inputs[node:], self._inputs[-node:]))


def _timings(search: Search, total_us: float) -> PlanTimings:
    return PlanTimings(search.linearise_us, search.solve_us, total_us)


def _as_plan_inputs(inputs: Array, request: PlanRequest) -> tuple[PlanInput, ...]:
    pushes = request.pushes or ((0.0, 0.0, 0.0),) * len(inputs)
    return tuple(
        PlanInput((u[0], u[1], u[2]), u[YAW_ACC], tuple(u[QDD_ARM:]), push, target.force)
        for u, push, target in zip(inputs.tolist(), pushes, request.targets, strict=False)
    )
