"""The program as filled against the same problem written a second time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fsw.barriers.soft_rows import TargetPoints
from fsw.model.airframe import AIRFRAME
from fsw.model.linearisation import Linearisation
from fsw.model.prediction import INPUTS, Array, condense
from fsw.mpc.costs import CostWeights, TrackingCost
from fsw.mpc.planner_config import PlannerConfig
from fsw.mpc.problem import Problem
from fsw.signals import SafeSet, Wall, WorkspaceSphere
from tests.fsw.mpc.optimum_by_cvxpy import Question, optimum
from tests.fsw.mpc.quadratics import quadratic
from tests.fsw.random_states import prediction_vector

CONFIG = PlannerConfig()
N = CONFIG.horizon
MODEL = condense(CONFIG.lag, CONFIG.period, N)
WALLS = SafeSet((Wall((-1.0, 0.0, 0.0), -1.0, 0.1), Wall((0.0, 1.0, 0.0), -1.0, 0.1)))
SPHERE = SafeSet(sphere=WorkspaceSphere((0.0, 0.0, -0.225), 0.075))


def question(random: np.random.Generator, safe_set: SafeSet) -> tuple[Array, Question]:
    """A start somewhere about the safe set, moving, and the horizon around a random guess."""
    start = prediction_vector(random)
    start[0:3] = random.uniform(-0.9, 0.9, 3)
    start[3:19] *= 0.4
    target_p = start[0:3] + np.array([0.0, 0.0, 0.225]) + random.uniform(-0.05, 0.05, (N + 1, 3))
    target_v = random.uniform(-0.3, 0.3, (N + 1, 3))
    guess = random.uniform(-1.0, 1.0, INPUTS * N)
    horizon = Linearisation(MODEL)
    horizon.refill(AIRFRAME, start, guess)
    return start, Question(horizon, guess, target_p, target_v, safe_set)


def targets_of(asked: Question) -> TargetPoints:
    return TargetPoints(asked.target_p, asked.target_v)


@pytest.mark.parametrize("safe_set", [SafeSet(), WALLS, SPHERE], ids=["open", "walls", "sphere"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_both_programs_have_the_same_optimum(safe_set: SafeSet, seed: int) -> None:
    start, asked = question(np.random.default_rng(seed), safe_set)
    problem = Problem(CONFIG, MODEL, safe_set)
    problem.linearise(start, asked.guess, targets_of(asked))
    answer = problem.solve()
    expected = optimum(asked, CONFIG)
    assert answer.usable
    # Yaw hardly matters to the cost, which leaves it this loose within the solver's tolerance.
    np.testing.assert_allclose(answer.x[: INPUTS * N], expected.inputs, atol=1e-2)
    np.testing.assert_allclose(
        answer.x[INPUTS * N : INPUTS * N + N], expected.joint_slack, atol=1e-4
    )
    worst = float(expected.barrier_slack.max()) if safe_set != SafeSet() else 0.0
    assert problem.largest_barrier_slack(answer.x) == pytest.approx(worst, abs=1e-3)


def test_printed_velocity_cost_is_a_switch() -> None:
    _, asked = question(np.random.default_rng(5), SafeSet())
    still = TargetPoints(asked.target_p, np.zeros_like(asked.target_v))
    printed = TrackingCost(CostWeights(relative_velocity=False))
    as_printed, _, _ = quadratic(printed, asked.horizon, asked.guess, targets_of(asked))
    about_rest, _, _ = quadratic(TrackingCost(CostWeights()), asked.horizon, asked.guess, still)
    assert as_printed == pytest.approx(about_rest)


def test_tilt_cone_is_about_the_tilt_the_acceleration_needs() -> None:
    """Pulled hard sideways the plan tilts to its limit and not beyond."""
    start = np.zeros(19)
    problem = Problem(CONFIG, MODEL, SafeSet())
    far = np.tile([50.0, 30.0, 0.0], (N + 1, 1))
    problem.linearise(start, np.zeros(INPUTS * N), TargetPoints(far, np.zeros((N + 1, 3))))
    ax, ay, az = problem.solve().x[0:3]
    assert math.atan2(math.hypot(ax, ay), 9.81 - az) == pytest.approx(CONFIG.limits.tilt, abs=1e-3)
    assert ay / ax == pytest.approx(0.6, rel=0.1)
