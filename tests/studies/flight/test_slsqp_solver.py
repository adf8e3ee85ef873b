"""The paper's optimiser and ours on the same nonlinear problem."""

from __future__ import annotations

import inspect
import itertools
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.optimize import approx_fprime, fmin_slsqp

from benchmarks.optimiser.slopes import slopes_of
from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.prediction import Array, condense
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.optimisers import Question, Search
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.qp_data import Solution
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import PlanFailure, SafeSet, SolverStatus
from studies.flight.rival_planners import VARIANTS
from studies.flight.slsqp_solver import (
    MAX_ITERATIONS,
    TOLERANCE,
    NonlinearProgram,
    by_slsqp,
    min_slacks,
    minimise,
)
from tests.fsw.autopilot.mpc.requests import STILL, below, hovering, planned, planner, request
from tests.fsw.autopilot.mpc.whole_program import whole
from tests.fsw.paper_arm import INPUTS, STATES

CONFIG = PlannerConfig(body="points")
N = CONFIG.horizon
MODEL = condense(AIRFRAME, CONFIG.period, N)
WALLS = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1), wall((0.0, 1.0, 0.0), -1.0, 0.1)))
SPHERE = SafeSet((target_sphere((0.0, 0.0, -0.225), 0.075),))
CASES = {"walls": WALLS, "sphere": SPHERE}


def instance(random: np.random.Generator, safe_set: SafeSet) -> tuple[Array, TargetPoints]:
    """Inside the safe set, with a target that moves on steadily, as in flight.

    In the sphere the vehicle moves with it, 20 mm off its centre: the directions of eq 23
    turn with the iterate, which the programs hold still and numeric gradients feel.
    """
    start = np.zeros(STATES)
    start[0:3] = random.uniform(-0.6, 0.6, 3)
    start[13] = random.uniform(-3.0, 3.0)
    start[15::2] = random.uniform(-0.5, 0.5, 2)
    speed = random.uniform(-0.15, 0.15, 3)
    off = random.normal(size=3)
    off *= 0.02 / np.linalg.norm(off)
    if safe_set is WALLS:
        start[0] = random.uniform(0.6, 0.8)  # the wall is at 0.9
        start[3:6] = random.uniform(-0.3, 0.3, 3)
    else:
        start[3:6] = speed
    along = CONFIG.period * np.arange(N + 1)[:, None] * speed
    at_start = start[0:3] + [0.0, 0.0, 0.225] + off
    return start, TargetPoints(at_start + along, np.tile(speed, (N + 1, 1)), np.zeros(N + 1))


def search(
    ocp: Ocp,
    start: Array,
    targets: TargetPoints,
    *,
    gradients: str = "analytic",
    max_iterations: int = MAX_ITERATIONS,
) -> Solution:
    problem = NonlinearProgram(ocp, start, targets)
    slopes = slopes_of(problem) if gradients == "analytic" else None
    return minimise(problem, max_iterations, slopes)


def price(ocp: Ocp, start: Array, targets: TargetPoints, inputs: Array) -> float:
    """Cost of inputs with the smallest slacks that admit them: what both optimisers minimise."""
    ocp.linearise(start, inputs, targets)
    program = ocp.qp
    return float(ocp.cost + program.penalty @ min_slacks(program, inputs))


def converged(ocp: Ocp, start: Array, targets: TargetPoints) -> Array:
    """Quadratic programs until the inputs stay."""
    inputs = np.zeros(INPUTS * N)
    for _ in range(40):
        ocp.linearise(start, inputs, targets)
        solution = ocp.solve()
        assert solution.usable
        change = float(np.abs(solution.x[: len(inputs)] - inputs).max())
        inputs = solution.x[: len(inputs)]
        if change < 1e-6:
            break
    return inputs


# Differences in place of slopes only for the barriers: they are twenty times as slow, and the
# slopes of every controller are compared with differences below.
SEARCHES = [
    ("blf", "analytic"),
    *(
        pytest.param(controller, "analytic", marks=pytest.mark.long)
        for controller in VARIANTS
        if controller != "blf"
    ),
    pytest.param("blf", "numeric", marks=pytest.mark.long),
]


@pytest.mark.drawn(2)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("controller", "gradients"), SEARCHES)
def test_both_optimisers_find_the_same_cost(controller: str, case: str, gradients: str) -> None:
    config = replace(CONFIG, controller=controller, hard_skipped_nodes=1)
    ocp = Ocp(config, MODEL, CASES[case])
    turning = controller == "blf" and case == "sphere"
    for seed in (2, 5, 8)[
        : 1 if gradients == "numeric" or turning else 3
    ]:  # whose programs converge
        start, targets = instance(np.random.default_rng(seed), CASES[case])
        answer = search(ocp, start, targets, gradients=gradients)
        # Where directions turn, analytic slopes leave the turning out, and the last line
        # searches may find no descent although the cost is reached.
        assert answer.usable or (turning and gradients == "analytic")
        ours = price(ocp, start, targets, converged(ocp, start, targets))
        theirs = price(ocp, start, targets, answer.x[: INPUTS * N])
        assert theirs == pytest.approx(ours, rel=0.02 if turning else 1e-4, abs=1e-5)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("controller", VARIANTS)
def test_analytic_slopes_are_those_of_the_cost_and_the_margins(controller: str, case: str) -> None:
    random = np.random.default_rng(5)
    ocp = Ocp(replace(CONFIG, controller=controller), MODEL, CASES[case])
    start, targets = instance(random, CASES[case])
    point = NonlinearProgram(ocp, start, targets)
    x = np.concatenate(
        (
            random.uniform(-0.3, 0.3, ocp.qp.inputs),
            random.uniform(0.0, 0.1, ocp.qp.unknowns - ocp.qp.inputs),
        )
    )
    cost_slope, margin_slopes = slopes_of(point)
    slope, slopes = cost_slope(x).copy(), margin_slopes(x)
    np.testing.assert_allclose(approx_fprime(x, point.cost, 1e-7), slope, rtol=1e-3, atol=1e-3)
    by_difference = approx_fprime(x, point.margins, 1e-7)
    if case == "sphere" and controller in ("hc", "blf"):
        # The directions of eqs 15 and 23 turn with the guess; the rows hold them still.
        inside = by_difference - slopes
        assert float(np.abs(inside).max()) < 0.2 * float(np.abs(slopes).max())
    else:
        np.testing.assert_allclose(by_difference, slopes, atol=1e-4)


def test_starts_at_rest_with_the_slacks_that_admit_it() -> None:
    start, targets = instance(np.random.default_rng(6), WALLS)
    start[3] = 1.0  # fast towards the wall: rest breaks the barrier
    point = NonlinearProgram(Ocp(CONFIG, MODEL, WALLS), start, targets)
    x = point.rest()
    assert (x[: INPUTS * N] == 0.0).all()
    assert x.max() > 0.0
    assert point.margins(x).min() == pytest.approx(0.0, abs=1e-12), "and no more than that"


def test_margins_and_bounds_together_admit_what_the_program_admits() -> None:
    random = np.random.default_rng(7)
    start, targets = instance(random, WALLS)
    ocp = Ocp(CONFIG, MODEL, WALLS)
    point = NonlinearProgram(ocp, start, targets)
    results = set()
    for _ in range(200):
        x = point.rest()
        x[: INPUTS * N] += random.uniform(-1.0, 1.0, INPUTS * N) * random.choice([0.1, 2.0, 5.0])
        x[3 : INPUTS * N : INPUTS] *= 0.05
        x[INPUTS * N :] += 3.0
        admitted = point.margins(x).min() >= 0.0 and all(
            (low is None or low <= value) and (high is None or value <= high)
            for value, (low, high) in zip(x, point.bounds(), strict=True)
        )
        point.cost(x)
        program = whole(ocp.qp)
        left = program.b - program.a @ x
        t, ax, ay = left[program.nonnegative_rows :].reshape(-1, 3).T
        expected = left[: program.nonnegative_rows].min() >= 0.0 and (t >= np.hypot(ax, ay)).all()
        assert admitted == expected
        results.add(admitted)
    assert results == {True, False}


def test_no_plan_without_convergence() -> None:
    start, targets = instance(np.random.default_rng(8), WALLS)
    answer = search(Ocp(CONFIG, MODEL, WALLS), start, targets, max_iterations=2)
    assert answer.status is SolverStatus.TIME_LIMIT
    assert not answer.usable


@pytest.mark.parametrize(
    ("mode", "status"),
    [
        (0, SolverStatus.SOLVED),
        (4, SolverStatus.INFEASIBLE),
        (9, SolverStatus.TIME_LIMIT),
        (8, SolverStatus.NUMERICAL_ERROR),
    ],
)
@pytest.mark.parametrize("broken", ["", "x", "fun"])
def test_only_what_slsqp_calls_converged_and_finite_is_solved(
    monkeypatch: pytest.MonkeyPatch, mode: int, status: SolverStatus, broken: str
) -> None:
    """By its exit modes: converged, incompatible, out of iterations, uphill."""
    start, targets = instance(np.random.default_rng(8), WALLS)
    problem = NonlinearProgram(Ocp(CONFIG, MODEL, WALLS), start, targets)
    said: dict[str, Any] = {"x": problem.rest(), "fun": 1.0, "status": mode, "nit": 3}
    if broken:
        said[broken] = math.nan * said[broken]
    monkeypatch.setattr("scipy.optimize.minimize", lambda *_, **__: SimpleNamespace(**said))
    answer = minimise(problem)
    assert answer.status is (SolverStatus.NUMERICAL_ERROR if broken else status)
    assert answer.usable is (mode == 0 and not broken)
    assert answer.iterations == 3


def test_it_stops_where_scipy_stops_by_default() -> None:
    defaults = inspect.signature(fmin_slsqp).parameters
    assert (defaults["iter"].default, defaults["acc"].default) == (MAX_ITERATIONS, TOLERANCE)


def test_what_cannot_be_kept_is_infeasible() -> None:
    """Far behind a hard wall: nothing brings the vehicle back within half a second."""
    start, targets = instance(np.random.default_rng(9), WALLS)
    start[0] = 3.0
    ocp = Ocp(replace(CONFIG, controller="hc"), MODEL, WALLS)
    answer = search(ocp, start, targets)
    assert not answer.usable


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("controller", VARIANTS)
def test_plans_come_back_through_the_planner(controller: str, case: str) -> None:
    start = hovering((0.2, 0.1, -1.2))
    asked = request(start, below((0.21, 0.1, -1.2), 0.225), CASES[case])
    config = replace(CONFIG, controller=controller)
    ours = planned(planner(replace(config, sqp_iterations=5)).plan(asked))
    theirs = planned(planner(replace(config, solver="slsqp")).plan(asked))
    assert theirs.status is SolverStatus.SOLVED
    assert theirs.sqp_iterations > 2
    # SLSQP also turns the sphere's directions, which a program holds: less than 1e-3 of the cost.
    assert theirs.cost == pytest.approx(ours.cost, rel=1e-3)
    np.testing.assert_allclose(theirs.inputs[0].a, ours.inputs[0].a, atol=0.05)
    np.testing.assert_allclose(theirs.inputs[0].qdd_arm, ours.inputs[0].qdd_arm, atol=0.3)


def test_what_is_not_finite_is_refused() -> None:
    slsqp = planner(replace(CONFIG, solver="slsqp"))
    lost = hovering()._replace(v=(math.nan, 0.0, 0.0))
    answer = slsqp.plan(request(lost, below(STILL)))
    assert isinstance(answer, PlanFailure)
    assert answer.status is SolverStatus.INPUT_REFUSED


@pytest.mark.long
def test_a_failure_is_no_plan() -> None:
    behind = hovering()._replace(p=(3.0, 0.0, -1.2))
    slsqp = planner(replace(CONFIG, controller="hc", solver="slsqp"))
    answer = slsqp.plan(request(behind, below((3.0, 0.0, -1.2)), WALLS))
    assert isinstance(answer, PlanFailure)
    assert answer.status is not SolverStatus.INPUT_REFUSED


def test_what_is_searched_in_one_piece_is_timed_in_one_piece(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = Solution(SolverStatus.SOLVED, np.zeros(INPUTS), 17)
    monkeypatch.setattr("studies.flight.slsqp_solver.NonlinearProgram", lambda *_: None)
    monkeypatch.setattr("studies.flight.slsqp_solver.minimise", lambda _: found)
    marks = itertools.count(5000, 1000)
    targets = TargetPoints(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2))
    question = Question(cast(Ocp, None), np.zeros(STATES), targets, np.zeros(INPUTS))
    search = by_slsqp(question, CONFIG, lambda: float(next(marks)))
    assert search == Search(found, 17, 17, linearise_us=0.0, solve_us=1000.0)
