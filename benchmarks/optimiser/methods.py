"""The optimisers that are compared, each behind one call that is timed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from benchmarks.optimiser.casadi_method import SOLVERS, CasadiMethod, given, installed
from benchmarks.optimiser.converged import target_points
from benchmarks.optimiser.instances import INPUTS, Instance
from benchmarks.optimiser.slopes import slopes_of
from benchmarks.optimiser.solved import Solved, stopwatch_us, timed
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.prediction import Array, condense, to_vector
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.qp_data import Solution
from fsw.autopilot.signals import Plan, SafeSet
from studies.flight.slsqp_solver import NonlinearProgram, minimise

_ITERATIONS = (1, 2, 3)


class Method(Protocol):
    """One optimiser for one horizon and safe set."""

    def solve(self, instance: Instance, guess: Array, optimum: Array) -> Solved:
        """Time one instance.

        Args:
            instance: The question and those before it.
            guess: Inputs (6 n,) [m/s^2, rad/s^2] of the running plan, moved on by one period.
            optimum: Inputs (6 n,) [m/s^2, rad/s^2] of the converged solution.
        """
        ...


Build = Callable[[PlannerConfig, Airframe, SafeSet], Method]


@dataclass(frozen=True, slots=True)
class Entry:
    """A method by name; ``build`` is None where its package is not installed."""

    name: str
    sqp_iterations: int | None  # None: until it converges
    build: Build | None
    given: str  # what it begins from, and in what form it computes


class PlannerMethod:
    """The planner as it flies, all of it: request in, plan out."""

    def __init__(self, config: PlannerConfig, airframe: Airframe, iterations: int) -> None:
        self._planner = Planner(replace(config, sqp_iterations=iterations), airframe, stopwatch_us)
        self._planner.warm_up()

    def solve(self, instance: Instance, guess: Array, optimum: Array) -> Solved:
        """See ``Method``; ``guess`` and ``optimum`` (6 n,) [m/s^2, rad/s^2] are not used."""
        for request in instance.before:
            self._planner.plan(request)
        plan, spent = timed(lambda: self._planner.plan(instance.request))
        if not isinstance(plan, Plan):
            return Solved(spent, None, None)
        timings = plan.timings
        return Solved(
            spent=spent,
            inputs=flat(plan),
            sqp_iterations=plan.sqp_iterations,
            linearise_us=timings.linearise_us,
            solve_us=timings.solve_us,
        )


class SlsqpMethod:
    """The paper's optimiser, from u = 0 as in the paper."""

    def __init__(
        self, config: PlannerConfig, airframe: Airframe, safe_set: SafeSet, *, analytic: bool
    ) -> None:
        model = condense(airframe, config.period, config.horizon)
        self._ocp = Ocp(config, model, safe_set)
        self._analytic = analytic

    def solve(self, instance: Instance, guess: Array, optimum: Array) -> Solved:
        """See ``Method``; ``guess`` and ``optimum`` (6 n,) [m/s^2, rad/s^2] are not used."""
        start, targets = to_vector(instance.request.start), target_points(instance.request)

        def search() -> Solution:
            problem = NonlinearProgram(self._ocp, start, targets)
            return minimise(problem, slopes=slopes_of(problem) if self._analytic else None)

        solution, spent = timed(search)
        inputs = solution.x[: len(guess)].copy() if solution.usable else None
        return Solved(spent, inputs, solution.iterations)


def entries() -> tuple[Entry, ...]:
    """Everything that is compared, in the order of the table."""

    def planner(solver: str, iterations: int) -> Build:
        return lambda config, airframe, _: PlannerMethod(
            replace(config, solver=solver), airframe, iterations
        )

    def slsqp(*, analytic: bool) -> Build:
        return partial(SlsqpMethod, analytic=analytic)

    def casadi(solver: str) -> Build:
        return partial(CasadiMethod, solver=solver)

    ours = "as it flies: the last plan moved on, functions compiled by numba"
    paper = "no inputs, as in the paper; our functions, compiled by numba; slopes"
    theirs = f"the last plan moved on and the states that follow; {given()}"
    return (
        *(Entry("clarabel", count, planner("clarabel", count), ours) for count in _ITERATIONS),
        Entry("slsqp-numeric", None, slsqp(analytic=False), f"{paper} by differences"),
        Entry("slsqp-analytic", None, slsqp(analytic=True), f"{paper} exact"),
        *(
            Entry(f"casadi-{name}", None, casadi(name) if installed(name) else None, theirs)
            for name in SOLVERS
        ),
    )


def guess_for(planner: Planner, instance: Instance) -> Array:
    """The running plan moved on by one period, as the planner guesses."""
    inputs = np.zeros(0)
    for request in instance.before:
        plan = planner.plan(request)
        inputs = flat(plan) if isinstance(plan, Plan) else np.zeros(0)
    if not len(inputs):
        return np.zeros(INPUTS * (len(instance.request.targets) - 1))
    return np.concatenate((inputs[INPUTS:], inputs[-INPUTS:]))


def flat(plan: Plan) -> Array:
    """Inputs of a plan, (6 n,)."""
    return np.array([(*u.a, u.yaw_acc, *u.qdd_arm) for u in plan.inputs]).ravel()
