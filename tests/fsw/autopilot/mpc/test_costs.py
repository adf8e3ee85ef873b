"""Every cost's quadratic model against finite differences of the cost itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.barriers.safe_approach import BarrierTuning
from fsw.autopilot.barriers.zone_rows import ZoneRows
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import YAW, Array, condense
from fsw.autopilot.mpc.costs import Cost, CostWeights, PostureCost, TrackingCost
from fsw.autopilot.mpc.planner_config import SoftWeights
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import SafeSet, Zone
from studies.flight.soft_costs import SphereCost, ZoneCost, one_sided_reciprocal
from tests.fsw.autopilot.mpc.quadratics import quadratic
from tests.fsw.paper_arm import INPUTS
from tests.fsw.random_states import prediction_vector

N = 5
MODEL = condense(AIRFRAME, 0.1, N)
WALLS = (wall((-1.0, 0.0, 0.0), -1.0, 0.1), wall((0.0, 0.6, 0.8), -1.5, 0.1))
POINTS = (point((0.3, -0.2, 0.1), 0.1), point((-0.5, 0.4, 0.6), 0.2))
SPHERE = target_sphere((0.0, 0.0, -0.225), 0.075)
SOFT = SoftWeights()


def soft(*zones: Zone, weights: SoftWeights = SOFT) -> ZoneCost:
    points, tuning = body_of("points", AIRFRAME), BarrierTuning()
    rows = ZoneRows(
        SafeSet(zones), points, MODEL, (tuning, tuning), distances=True, skipped_nodes=0
    )
    return ZoneCost(rows, weights)


COSTS: dict[str, Cost] = {
    "tracking": TrackingCost(CostWeights()),
    "printed": TrackingCost(CostWeights(relative_velocity=False)),
    "posture": PostureCost(CostWeights(), AIRFRAME),
    "soft walls": soft(*WALLS),
    "soft points": soft(*POINTS),
    "outside the sphere": SphereCost(SPHERE, (5.0, 20.0), only_outside=True),
    "centring": SphereCost(SPHERE, (100.0, 500.0), only_outside=False),
}


def horizon_of(start: Array, inputs: Array) -> Linearisation:
    horizon = Linearisation(MODEL)
    horizon.refill(start, inputs)
    return horizon


@pytest.mark.parametrize("cost", COSTS.values(), ids=COSTS.keys())
def test_slope_is_the_finite_difference_and_the_model_is_convex(cost: Cost) -> None:
    random = np.random.default_rng(1)
    for _ in range(3):
        start, guess = prediction_vector(random), random.uniform(-1.0, 1.0, INPUTS * N)
        start[0:3] = 0.2 * start[0:3]
        targets = TargetPoints(
            start[0:3] + random.uniform(-0.3, 0.3, (N + 1, 3)),
            random.uniform(-0.3, 0.3, (N + 1, 3)),
            start[YAW] + random.uniform(-2.5, 2.5, N + 1),
            random.uniform(-1.0, 1.0, (N + 1, 2)),
        )
        _, slope, hessian = quadratic(cost, horizon_of(start, guess), guess, targets)
        assert slope.any() or cost is COSTS["outside the sphere"]
        for column in range(INPUTS * N):
            step = np.zeros(INPUTS * N)
            step[column] = 1e-6
            above, below = (
                quadratic(cost, horizon_of(start, u), u, targets)[0]
                for u in (guess + step, guess - step)
            )
            assert slope[column] == pytest.approx((above - below) / 2e-6, rel=1e-4, abs=1e-4)
        assert np.linalg.eigvalsh(hessian).min() > -1e-9 * np.abs(hessian).max()


def test_terminal_node_weighs_five_times_as_table_two_says() -> None:
    """A pure position error, the same at every node: n - 1 at 10 and one at 50."""
    start, guess = np.zeros(19), np.zeros(INPUTS * N)
    horizon = horizon_of(start, guess)
    error = np.array([0.1, -0.2, 0.05])
    tip = horizon.tracked.position
    targets = TargetPoints(tip - error, np.zeros((N + 1, 3)), np.zeros(N + 1))
    value, _, _ = quadratic(TrackingCost(CostWeights()), horizon, guess, targets)
    assert value == pytest.approx(float(error @ error) * (10.0 * (N - 1) + 50.0))


def test_joints_that_are_asked_for_weigh_alike_at_every_node_and_none_weigh_nothing() -> None:
    start, guess = np.zeros(19), np.zeros(INPUTS * N)
    horizon = horizon_of(start, guess)
    points = (horizon.tracked.position, np.zeros((N + 1, 3)), np.zeros(N + 1))
    asked = TargetPoints(*points, np.tile([0.3, -0.4], (N + 1, 1)))
    cost = PostureCost(CostWeights(posture=8.0), AIRFRAME)
    assert quadratic(cost, horizon, guess, asked)[0] == pytest.approx(8.0 * 0.25 * N)
    value, slope, _ = quadratic(cost, horizon, guess, TargetPoints(*points))
    assert (value, slope.any()) == (0.0, False)


@pytest.mark.parametrize(
    ("yaw", "target", "short_way"), [(3.0, -3.0, 1.0), (-3.0, 3.0, -1.0), (0.1, 0.4, 1.0)]
)
def test_the_heading_is_pulled_the_short_way_across_south(
    yaw: float, target: float, short_way: float
) -> None:
    start, guess = np.zeros(19), np.zeros(INPUTS * N)
    start[YAW] = yaw
    horizon = horizon_of(start, guess)
    there = TargetPoints(horizon.tracked.position, np.zeros((N + 1, 3)), np.full(N + 1, target))
    value, slope, _ = quadratic(TrackingCost(CostWeights()), horizon, guess, there)
    turn = (target - yaw + np.pi) % (2.0 * np.pi) - np.pi
    assert value == pytest.approx(N * CostWeights().yaw * turn**2)
    assert short_way * slope[3] < 0.0


@given(st.floats(-1.0, 3.0), st.floats(1e-3, 1.0), st.floats(1.0, 20.0))
def test_soft_wall_always_pushes_away_and_more_when_closer(
    gap: float, more: float, weight: float
) -> None:
    near, far = one_sided_reciprocal(gap, weight), one_sided_reciprocal(gap + more, weight)
    assert near[0] > far[0] > 0.0
    assert near[1] < far[1] < 0.0
    assert near[2] > 0.0


@pytest.mark.parametrize("gap", [0.02, 0.05, 0.5, 2.0])
def test_soft_wall_is_eq_29_beyond_a_small_gap(gap: float) -> None:
    expected = (1.0 / (5.0 * gap**2), -2.0 / (5.0 * gap**3), 6.0 / (5.0 * gap**4))
    assert one_sided_reciprocal(gap, 5.0) == pytest.approx(expected)


def test_soft_wall_goes_on_as_a_parabola_from_there() -> None:
    value, slope, curvature = one_sided_reciprocal(0.02, 5.0)
    for into in (0.001, 0.02, 1.0):
        on = one_sided_reciprocal(0.02 - into, 5.0)
        assert on[0] == pytest.approx(value - slope * into + 0.5 * curvature * into**2)
        assert on[1:] == pytest.approx((slope - curvature * into, curvature))


def test_soft_walls_weigh_by_their_node_in_the_denominator() -> None:
    """At rest all nodes are alike: n - 1 of them at w_4 and one at w_s4."""
    guess = np.zeros(INPUTS * N)
    horizon = horizon_of(np.zeros(19), guess)
    targets = TargetPoints(np.zeros((N + 1, 3)), np.zeros((N + 1, 3)), np.zeros(N + 1))
    light, heavy = (
        quadratic(
            soft(*WALLS, weights=SoftWeights(wall=4.0, wall_terminal=w)),
            horizon,
            guess,
            targets,
        )[0]
        for w in (4.0, 16.0)
    )
    assert heavy / light == pytest.approx((N - 1 + 0.25) / N)


def test_sphere_cost_of_eq_30_is_silent_inside() -> None:
    start, guess = np.zeros(19), np.zeros(INPUTS * N)
    horizon = horizon_of(start, guess)
    centre = TargetPoints(
        horizon.states[:, 0:3] - np.array(SPHERE.shape.numbers[:3]) + 0.01,
        np.zeros((N + 1, 3)),
        np.zeros(N + 1),
    )
    inside, slope, _ = quadratic(COSTS["outside the sphere"], horizon, guess, centre)
    assert inside == 0.0
    assert not slope.any()
    assert quadratic(COSTS["centring"], horizon, guess, centre)[0] > 0.0
