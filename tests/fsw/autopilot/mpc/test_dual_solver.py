"""The solver by multipliers against Clarabel on the whole program, unknown by unknown."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import clarabel
import numpy as np
import pytest

import studies.flight.rival_planners  # noqa: F401 - whose names configurations have
from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.prediction import Array, condense
from fsw.autopilot.mpc.clarabel_solver import ClarabelSolver
from fsw.autopilot.mpc.dual_solver import DualSolver
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.qp_data import QpData
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import SafeSet, SolverStatus
from studies.flight.slsqp_solver import min_slacks
from tests.fsw.autopilot.mpc.whole_program import whole
from tests.fsw.paper_arm import INPUTS
from tests.fsw.random_states import prediction_vector

CONFIG = PlannerConfig(body="points")
WALLS = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1), wall((0.0, 1.0, 0.0), -1.0, 0.1)))
SPHERE = SafeSet((target_sphere((0.0, 0.0, -0.225), 0.075),))
# Yaw hardly matters to the cost, which leaves it loose within the solver's tolerance.
LOOSE = np.array([1.0, 1.0, 1.0, 10.0, 1.0, 1.0])


def filled(
    random: np.random.Generator,
    safe_set: SafeSet,
    *,
    config: PlannerConfig = CONFIG,
    off: float = 0.05,
) -> Ocp:
    """A program around rest, of a vehicle somewhere, moving, its target so far off [m]."""
    n = config.horizon
    ocp = Ocp(config, condense(AIRFRAME, config.period, n), safe_set)
    start = prediction_vector(random)
    start[0:3] = random.uniform(-0.9, 0.9, 3)
    start[3:19] *= 0.4
    about = start[0:3] + np.array([0.0, 0.0, 0.225]) + random.uniform(-off, off, 3)
    targets = TargetPoints(
        about + random.uniform(-0.02, 0.02, (n + 1, 3)),
        random.uniform(-0.3, 0.3, (n + 1, 3)),
        start[13] + random.uniform(-1.0, 1.0, n + 1),
    )
    ocp.linearise(start, np.zeros(INPUTS * n), targets)
    return ocp


def difference(x: Array, expected: Array, inputs: int) -> float:
    scaled = (x - expected)[:inputs] / np.tile(LOOSE, inputs // INPUTS)
    return float(np.abs(scaled).max())


def cost(program: QpData, x: Array) -> float:
    p, q = whole(program)[:2]
    return float(q @ x + 0.5 * x @ (p + np.triu(p, 1).T) @ x)


def exactly(program: QpData) -> Array:
    """The optimum of the whole program as exactly as an interior-point method can have it."""
    same, settings = whole(program).sparse(), clarabel.DefaultSettings()
    settings.verbose, settings.max_iter = False, 200
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    cones = [clarabel.NonnegativeConeT(same.nonnegative_rows)]
    cones += [clarabel.SecondOrderConeT(3)] * same.cones
    answer = clarabel.DefaultSolver(same.p, same.q, same.a, same.b, cones, settings).solve()
    # It may end a hair above 1e-10 (seen: 1.03e-10); what is compared is known to 1e-6.
    assert answer.status in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
    assert max(answer.r_prim, answer.r_dual) < 1e-9
    return np.array(answer.x)


def soft_cost(program: QpData, x: Array) -> float:
    """The cost of the inputs in ``x``, softened as little as can be."""
    inputs = x[: program.inputs]
    return cost(program, np.concatenate((inputs, min_slacks(program, inputs))))


@pytest.mark.drawn(2)
@pytest.mark.parametrize("horizon", [1, 5, pytest.param(20, marks=pytest.mark.long)])
@pytest.mark.parametrize("off", [0.05, 5.0], ids=["near", "far"])
@pytest.mark.parametrize("safe_set", [SafeSet(), WALLS, SPHERE], ids=["open", "walls", "sphere"])
def test_the_optimum_is_that_of_the_whole_program(
    safe_set: SafeSet, off: float, horizon: int
) -> None:
    """Far off, tilt cones and input bounds bind as well, and the barrier gives way.

    The solver ends at a relative gap of 1e-6 of its own program, whose value is what the rows cost:
    the optimum less that without rows. The cost is convex: inputs that cost so much more are no
    farther from the optimum in the norm of the Hessian. At horizon 20, far outside a sphere, rows
    cost 5,400 of a cost of 370: the gap is 4e-3, 1.2e-5 of the cost, and 0.06 in an input. Clarabel
    on the whole program, at the same tolerance, is 2e-5 off, as its gap is one of the cost.
    """
    random = np.random.default_rng(7)
    config = replace(
        CONFIG,
        horizon=horizon,
        walls=replace(CONFIG.walls, skipped_nodes=0),
        workspace=replace(CONFIG.workspace, skipped_nodes=0),
    )
    cones_bound = 0
    for _ in range(6):
        ocp = filled(random, safe_set, config=config, off=off)
        program, found = ocp.qp, ocp.solve()
        assert found.usable
        inputs, best = found.x[: program.inputs], exactly(program)
        least = soft_cost(program, best)
        hessian = np.triu(program.hessian) + np.triu(program.hessian, 1).T
        free = -np.linalg.solve(hessian, program.linear)
        rows_cost = least - float(program.linear @ free + 0.5 * free @ hessian @ free)
        gap = 1.5e-6 * rows_cost + 1e-6
        assert -1e-8 * abs(least) - 1e-8 <= soft_cost(program, found.x) - least <= gap
        off_by = inputs - best[: program.inputs]
        assert 0.5 * off_by @ hessian @ off_by <= gap
        np.testing.assert_allclose(
            found.x[program.inputs :], min_slacks(program, inputs), atol=1e-4
        )
        softened = np.append(found.x[program.inputs :], 0.0)
        left = program.rows.b - program.rows.g @ found.x[: program.inputs]
        left += softened[program.rows.slack]
        assert left[: program.rows.first_cone].min() > -1e-4
        cones = left[program.rows.first_cone :].reshape(-1, 3)
        room = cones[:, 0] - np.hypot(cones[:, 1], cones[:, 2])
        assert room.min() > -1e-4
        cones_bound += bool(room.min() < 1e-3)
    assert cones_bound >= 3 or off < 1.0


@pytest.mark.parametrize("joint", [1.2, -1.2])
def test_an_arm_outside_its_limits_is_softened_at_every_node_as_little_as_can_be(
    joint: float,
) -> None:
    """The first slack too: no input brings the arm back within one period."""
    ocp = Ocp(CONFIG, condense(AIRFRAME, CONFIG.period, CONFIG.horizon), SafeSet())
    start, n = np.zeros(19), CONFIG.horizon
    start[15] = joint
    still = TargetPoints(np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.zeros(n + 1))
    ocp.linearise(start, np.zeros(INPUTS * n), still)
    found, expected = ocp.solve(), ClarabelSolver(whole(ocp.qp).sparse()).solve()
    assert found.usable
    assert expected.usable
    slacks = found.x[ocp.qp.inputs :]
    assert slacks[0] > 0.1
    np.testing.assert_allclose(slacks, expected.x[ocp.qp.inputs :], atol=1e-3)
    np.testing.assert_allclose(slacks, min_slacks(ocp.qp, found.x[: ocp.qp.inputs]), atol=1e-4)


@pytest.mark.parametrize("safe_set", [WALLS, SPHERE], ids=["walls", "sphere"])
def test_the_optimum_is_that_of_the_program_as_filled_last(safe_set: SafeSet) -> None:
    random = np.random.default_rng(12)
    for _ in range(3):
        ocp = filled(random, safe_set)
        found = ocp.solve()
        assert found.usable
        best = exactly(ocp.qp)
        assert difference(found.x, best, ocp.qp.inputs) < 0.01
        np.testing.assert_allclose(
            found.x[ocp.qp.inputs :], best[ocp.qp.inputs :], rtol=0.0, atol=1e-3
        )


@pytest.mark.drawn(1)
@pytest.mark.parametrize("safe_set", [WALLS, SPHERE], ids=["walls", "sphere"])
def test_the_guess_says_where_to_look_and_not_what_is_found(safe_set: SafeSet) -> None:
    random = np.random.default_rng(8)
    for _ in range(10):
        ocp = filled(random, safe_set)
        program, solver = ocp.qp, DualSolver(ocp.qp)
        first = solver.solve(np.zeros(program.inputs)).x
        for size in (0.1, 3.0, 30.0):
            again = solver.solve(random.uniform(-size, size, program.inputs)).x
            assert difference(again, first, program.inputs) < 0.01


def test_what_was_solved_before_leaves_no_trace() -> None:
    random = np.random.default_rng(9)
    one, other = filled(random, WALLS), filled(random, WALLS)
    fresh = one.solve().x
    kept = DualSolver(one.qp)
    numbers = (one.qp.hessian, one.qp.linear, one.qp.rows.g, one.qp.rows.b)
    saved = [array.copy() for array in numbers]
    theirs = other.qp
    for array, another in zip(
        numbers, (theirs.hessian, theirs.linear, theirs.rows.g, theirs.rows.b), strict=True
    ):
        array[:] = another
    kept.solve(np.zeros(theirs.inputs))
    for array, original in zip(numbers, saved, strict=True):
        array[:] = original
    np.testing.assert_array_equal(kept.solve(np.zeros(theirs.inputs)).x, fresh)


@pytest.mark.long
def test_a_vehicle_that_is_lost_does_not_fill_the_memory() -> None:
    """From everywhere other rows bind, a hundred at once: a program of these takes 0.6 MB."""
    sides = ((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 1.0, 0.0))
    room = SafeSet(tuple(wall(side, -1.0, 0.1) for side in sides))
    random = np.random.default_rng(10)
    program = filled(random, room, config=PlannerConfig(body="full")).qp
    solver = DualSolver(program)

    def solve(times: int) -> float:
        for _ in range(times):
            solver.solve(random.uniform(-30.0, 30.0, program.inputs))
        return _private_mb()

    settled = solve(5)
    assert solve(20) - settled < 5.0  # 64 of them take 40 MB


def _private_mb() -> float:
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("RssAnon")) / 1024.0


def test_hard_rows_that_contradict_each_other_are_infeasible() -> None:
    """Two walls, 0.2 m apart, that both want 0.5 m."""
    narrow = SafeSet((wall((1.0, 0.0, 0.0), -0.1, 0.5), wall((-1.0, 0.0, 0.0), -0.1, 0.5)))
    ocp = filled(np.random.default_rng(10), narrow, config=replace(CONFIG, controller="hc"))
    assert ocp.solve().status is SolverStatus.INFEASIBLE


def test_a_hessian_that_is_not_positive_is_never_flown() -> None:
    ocp = filled(np.random.default_rng(11), WALLS)
    ocp.qp.hessian[0, 0] = -1.0
    assert ocp.solve().status is SolverStatus.NUMERICAL_ERROR


@pytest.mark.parametrize("where", ["hessian", "linear", "g", "b"])
def test_what_is_not_a_number_is_never_flown(where: str) -> None:
    ocp = filled(np.random.default_rng(13), WALLS)
    numbers = getattr(ocp.qp, where, None)
    array = getattr(ocp.qp.rows, where) if numbers is None else numbers
    array[(0,) * array.ndim] = np.nan
    assert not ocp.solve().usable
