"""The arm puts the end-effector where the plan wants it, seen from where the base really is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.arm_compensation import (
    CompensationLimits,
    lately_off_plan,
)
from fsw.autopilot.control.joint_reference import JointReferenceLimits
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.arm_coordinates import arm_coordinates
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import JointVector, PredictionState, StateEstimate
from tests.fsw.autopilot.model.geometry_by_rotation import attitude, tips
from tests.fsw.random_states import estimate_of, vec3
from tests.fsw.records import boundless, compensated_joints

LENGTHS = np.array((0.15, 0.15))
LIMITS = CompensationLimits()
BOUNDLESS = boundless(AIRFRAME)
# Three steps end so near; damping, and a pose that is a step old, take so much of a rate.
CLOSE, SLOW = 2e-6, 3e-3  # m, rad/s
MOST = tuple(high - JointReferenceLimits().margin for high in arm_coordinates(AIRFRAME).high[:2])
JOINTS = JointReferenceLimits()
UNBOUNDED = replace(LIMITS, whole=0.3, most=0.4)


def plan_of(random: np.random.Generator) -> PredictionState:
    """A bent arm on either side, tilted and turned anyhow, well within its limits."""
    elbow = float(random.choice([-1.0, 1.0])) * random.uniform(0.9, 1.5)
    ax, ay = (float(a) for a in random.uniform(-1.5, 1.5, 2))
    return PredictionState(
        p=vec3(random.uniform(-1.0, 1.0, 3)),
        v=vec3(random.uniform(-0.3, 0.3, 3)),
        a=(ax, ay, 0.3),
        j=(0.2, -0.3),
        s=(0.0, 0.0),
        yaw=float(random.uniform(-math.pi, math.pi)),
        yaw_rate=0.1,
        q_arm=(float(-0.5 * elbow + random.uniform(-0.1, 0.1)), float(elbow)),
        qd_arm=(0.1, -0.2),
    )


def attitude_of(plan: PredictionState) -> Rotation:
    return attitude(np.array(plan.a), plan.yaw)


def pushed_within_the_arms_plane(
    plan: PredictionState, along: float, up: float, lean: float
) -> StateEstimate:
    """The base displaced and leaning where the arm can still make up for all of it."""
    R_WB = attitude_of(plan)
    away = R_WB.apply([along, 0.0, up])
    return estimate_of(
        R_WB * Rotation.from_euler("Y", lean),
        (0.0, 0.2, 0.0),
        vec3(np.array(plan.p) + away),
        vec3(np.array(plan.v) + 0.05),
        q_arm=plan.q_arm,
    )


def planned_end_effector(plan: PredictionState) -> Array:
    return np.asarray(tips(np.array(plan.p), attitude_of(plan), np.array(plan.q_arm), LENGTHS)[1])


def reached(estimate: StateEstimate, q_arm: JointVector) -> Array:
    R_WB = Rotation.from_matrix(np.reshape(estimate.R_WB, (3, 3)))
    return np.asarray(tips(np.array(estimate.p_WB), R_WB, np.array(q_arm), LENGTHS)[1])


@pytest.mark.parametrize("seed", range(10))
def test_a_pushed_base_does_not_move_the_end_effector(seed: int) -> None:
    random = np.random.default_rng(seed)
    plan = plan_of(random)
    along, up, lean = (float(x) for x in random.uniform(-0.012, 0.012, 3))
    estimate = pushed_within_the_arms_plane(plan, along, up, lean)
    q_arm, _ = compensated_joints(AIRFRAME, LIMITS, JOINTS, 0.0, estimate, plan)
    planned = planned_end_effector(plan)
    np.testing.assert_allclose(reached(estimate, q_arm), planned, atol=CLOSE)
    assert q_arm[1] * plan.q_arm[1] > 0.0, "the elbow keeps its side"


@pytest.mark.parametrize("seed", range(5))
def test_on_the_plan_nothing_is_compensated(seed: int) -> None:
    plan = plan_of(np.random.default_rng(seed))
    estimate = pushed_within_the_arms_plane(plan, 0.0, 0.0, 0.0)
    q_arm, _ = compensated_joints(AIRFRAME, LIMITS, JOINTS, 0.0, estimate, plan)
    assert q_arm == pytest.approx(plan.q_arm)


@pytest.mark.parametrize("seed", range(5))
def test_rates_are_those_of_the_angles_along_the_motion(seed: int) -> None:
    """Plan and base moved on by a moment; the plan's end-effector at its own velocity."""
    random = np.random.default_rng(seed)
    plan = plan_of(random)._replace(j=(0.0, 0.0), yaw_rate=0.0)
    estimate = pushed_within_the_arms_plane(plan, 0.01, -0.01, 0.02)
    _, rates = compensated_joints(AIRFRAME, LIMITS, JOINTS, 0.0, estimate, plan)
    moment = 1e-5
    angles = [later(plan, estimate, t) for t in (-moment, moment)]
    expected = (np.array(angles[1]) - np.array(angles[0])) / (2.0 * moment)
    np.testing.assert_allclose(rates, expected, atol=SLOW)


def later(
    plan: PredictionState, estimate: StateEstimate, t: float, limits: CompensationLimits = LIMITS
) -> JointVector:
    R_WB = Rotation.from_matrix(np.reshape(estimate.R_WB, (3, 3)))
    moved = estimate_of(
        R_WB * Rotation.from_rotvec(t * np.array(estimate.w_WB_B)),
        estimate.w_WB_B,
        vec3(np.array(estimate.p_WB) + t * np.array(estimate.v_WB)),
        estimate.v_WB,
        estimate.q_arm,
    )
    q1, q2 = (float(q) for q in np.array(plan.q_arm) + t * np.array(plan.qd_arm))
    ahead = plan._replace(p=vec3(np.array(plan.p) + t * np.array(plan.v)), q_arm=(q1, q2))
    return compensated_joints(AIRFRAME, limits, JOINTS, 0.0, moved, ahead)[0]


def bent_plan(q_arm: JointVector) -> PredictionState:
    return plan_of(np.random.default_rng(3))._replace(q_arm=q_arm)


# Near to a limit of the first joint, near to one of the second link, and the same mirrored. The
# base is pushed, and leans, by what the limits cannot make up for; compensation is whole there.
NEAR_A_LIMIT = [
    ((1.0, -0.8), 0.0, -0.3, 0), ((-1.0, 0.8), 0.0, 0.3, 0),
    ((0.3, 1.2), 0.0, -0.3, 1), ((-0.3, -1.2), 0.0, 0.3, 1),
]  # fmt: skip


@pytest.mark.drawn(1)
@pytest.mark.parametrize(("q_arm", "along", "lean", "which"), NEAR_A_LIMIT)
def test_an_arm_that_would_have_to_pass_a_limit_takes_the_nearest_pose_within_them(
    q_arm: JointVector, along: float, lean: float, which: int
) -> None:
    plan = bent_plan(q_arm)
    estimate = pushed_within_the_arms_plane(plan, along, 0.0, lean)
    off_plan = math.dist(estimate.p_WB, plan.p)
    assert off_plan < UNBOUNDED.whole, "compensation is whole here"
    free, _ = compensated_joints(BOUNDLESS, UNBOUNDED, JOINTS, 0.0, estimate, plan)
    kept, rates = compensated_joints(AIRFRAME, UNBOUNDED, JOINTS, 0.0, estimate, plan)
    most = MOST
    links_free, links = (free[0], sum(free)), (kept[0], sum(kept))
    assert abs(links_free[which]) > most[which] + 0.02, "the free arm passes the limit"
    assert abs(links[0]) <= most[0] + 1e-12
    assert abs(links[1]) <= most[1] + 1e-12
    planned = planned_end_effector(plan)
    miss = math.dist(reached(estimate, kept), planned)
    for first in np.linspace(-most[0], most[0], 60):
        for both in np.linspace(-most[1], most[1], 60):
            if (both - first) * q_arm[1] < 0.0:
                continue  # the elbow keeps its side
            other = math.dist(reached(estimate, (first, both - first)), planned)
            assert miss <= other + 0.005, "0.985 of the reach is 4.5 mm less than all of it"
    held = [link for link in (0, 1) if abs(abs(links[link]) - most[link]) < 1e-12]
    assert held, "a link stands at its limit"
    link_rates = (rates[0], sum(rates))
    assert all(link_rates[link] == pytest.approx(0.0, abs=1e-12) for link in held)


@pytest.mark.parametrize("seed", range(200))
def test_at_any_state_the_arm_is_sent_to_a_pose_within_its_limits(seed: int) -> None:
    """Anyhow pushed, leaning and bent; without the clamp most of these leave them."""
    random = np.random.default_rng(seed)
    q1, q12 = random.uniform(-1.0, 1.0, 2) * MOST
    plan = bent_plan((float(q1), float(q12 - q1)))
    along, up, lean = (float(x) for x in random.uniform(-0.06, 0.06, 3))
    estimate = pushed_within_the_arms_plane(plan, along, up, 5.0 * lean)
    q_arm, rates = compensated_joints(AIRFRAME, UNBOUNDED, JOINTS, 0.0, estimate, plan)
    most = MOST
    assert abs(q_arm[0]) <= most[0] + 1e-12
    assert abs(sum(q_arm)) <= most[1] + 1e-12
    assert all(map(math.isfinite, rates))


def test_most_random_states_would_leave_the_limits_if_they_could() -> None:
    left = 0
    for seed in range(200):
        random = np.random.default_rng(seed)
        q1, q12 = random.uniform(-1.0, 1.0, 2) * MOST
        plan = bent_plan((float(q1), float(q12 - q1)))
        along, up, lean = (float(x) for x in random.uniform(-0.06, 0.06, 3))
        estimate = pushed_within_the_arms_plane(plan, along, up, 5.0 * lean)
        free, _ = compensated_joints(BOUNDLESS, UNBOUNDED, JOINTS, 0.0, estimate, plan)
        most = MOST
        left += abs(free[0]) > most[0] or abs(sum(free)) > most[1]
    assert left >= 30


def test_rates_at_a_limit_are_those_of_the_nearest_pose_along_the_motion() -> None:
    plan = bent_plan((1.0, -0.8))._replace(j=(0.0, 0.0), yaw_rate=0.0)
    estimate = pushed_within_the_arms_plane(plan, 0.0, 0.0, -0.2)
    _, rates = compensated_joints(AIRFRAME, UNBOUNDED, JOINTS, 0.0, estimate, plan)
    moment = 1e-5
    angles = [later(plan, estimate, t, UNBOUNDED) for t in (-moment, moment)]
    expected = (np.array(angles[1]) - np.array(angles[0])) / (2.0 * moment)
    assert rates[0] == pytest.approx(0.0, abs=1e-9)
    assert rates[1] == pytest.approx(expected[1], rel=0.2)  # how the miss bends the way is left out
    assert abs(rates[1]) > 0.01, "one link moves"


@pytest.mark.parametrize("seed", range(20))
def test_out_of_reach_the_arm_points_at_the_place_on_its_own_side(seed: int) -> None:
    random = np.random.default_rng(seed)
    bend = float(random.choice([-1.0, 1.0])) * random.uniform(0.5, 0.7)
    lean = float(random.uniform(-0.3, 0.3))
    plan = bent_plan((lean - 0.5 * bend, bend))._replace(a=(0.0, 0.0, 0.0), yaw=0.0)
    estimate = pushed_within_the_arms_plane(
        plan, -0.03 * math.sin(lean), -0.03 * math.cos(lean), 0.0
    )
    q_arm, rates = compensated_joints(BOUNDLESS, UNBOUNDED, JOINTS, 0.0, estimate, plan)
    seen = planned_end_effector(plan) - np.array(estimate.p_WB)
    assert np.linalg.norm(seen) > LENGTHS.sum()
    tip = reached(estimate, q_arm) - np.array(estimate.p_WB)
    assert np.linalg.norm(tip) > 0.98 * LENGTHS.sum()
    assert tip @ seen > 0.999 * np.linalg.norm(tip) * np.linalg.norm(seen)
    assert q_arm[1] * bend > -0.1
    assert max(map(abs, rates)) < 10.0


@pytest.mark.parametrize("straight", [0.0, 0.02])
def test_an_arm_that_is_nearly_straight_is_asked_for_a_bounded_rate(straight: float) -> None:
    """It can hardly move along itself: the rates that would be needed have no bound."""
    plan = bent_plan((0.2, straight))._replace(v=(3.0, 0.0, 2.0))
    estimate = pushed_within_the_arms_plane(plan, 0.0, 0.0, 0.0)._replace(v_WB=(0.0, 0.0, 0.0))
    rates = compensated_joints(AIRFRAME, LIMITS, JOINTS, 0.0, estimate, plan)[1]
    # v / (2 of the damping) of either link.
    assert max(map(abs, rates)) < 4.0 * math.hypot(3.0, 2.0) / (2.0 * 0.003)


@pytest.mark.parametrize("metres", [0.0, 0.019])
def test_up_to_the_limit_the_end_effector_is_held_wholly_across_links_of_unlike_length(
    metres: float,
) -> None:
    bodies = replace(
        AIRFRAME.bodies, offset=(0.0, 0.0, 0.0, 0.0, 0.0, 0.18, *(0.0,) * 12), tip=(0.0, 0.0, 0.13)
    )
    unlike, lengths = replace(BOUNDLESS, bodies=bodies), np.array((0.18, 0.13))
    plan = bent_plan((-0.6, 1.4))
    estimate = pushed_within_the_arms_plane(plan, 0.0, metres, 0.0)
    q_arm, _ = compensated_joints(unlike, LIMITS, JOINTS, 0.0, estimate, plan)
    R_WB = Rotation.from_matrix(np.reshape(estimate.R_WB, (3, 3)))
    tip = tips(np.array(estimate.p_WB), R_WB, np.array(q_arm), lengths)[1]
    planned = tips(np.array(plan.p), attitude_of(plan), np.array(plan.q_arm), lengths)[1]
    np.testing.assert_allclose(tip, planned, atol=CLOSE)


@pytest.mark.parametrize("bend", [-0.1, 0.1])
@pytest.mark.parametrize("along", [-0.02, 0.02])
def test_a_nearly_straight_arm_stays_on_its_side_and_holds_what_it_can_reach(
    bend: float, along: float
) -> None:
    """Pushed towards the end-effector it folds, pushed away it points at it, at full reach."""
    plan = plan_of(np.random.default_rng(2))._replace(q_arm=(-0.6, bend))
    estimate = pushed_within_the_arms_plane(plan, along, 0.0, 0.0)
    q_arm, _ = compensated_joints(AIRFRAME, LIMITS, JOINTS, 0.0, estimate, plan)
    planned = planned_end_effector(plan)
    left = float(np.linalg.norm(reached(estimate, q_arm) - planned))
    idle = float(np.linalg.norm(reached(estimate, plan.q_arm) - planned))
    assert idle == pytest.approx(abs(along))
    assert q_arm[1] * bend > 0.0 or abs(q_arm[1]) < 0.02
    assert left < 0.9 * idle


@pytest.mark.parametrize("along", [1.0, -1.0])
def test_a_far_end_effector_is_followed_so_far_and_without_a_jump(along: float) -> None:
    """The place it is moved to grows with the deviation, ever more slowly, and stays within."""
    plan = plan_of(np.random.default_rng(4))
    idle = np.array(reached(pushed_within_the_arms_plane(plan, 0.0, 0.0, 0.0), plan.q_arm))
    moved = []
    for metres in np.arange(0.0, 0.1, 0.001):
        estimate = pushed_within_the_arms_plane(plan, along * float(metres), 0.0, 0.0)
        q_arm, _ = compensated_joints(AIRFRAME, LIMITS, JOINTS, 0.0, estimate, plan)
        shift = np.array(estimate.p_WB) - np.array(plan.p)
        moved.append(float(np.linalg.norm(reached(estimate, q_arm) - shift - idle)))
    steps = np.diff(moved)
    assert steps.max() < 1.05e-3
    assert steps.min() > -1e-9
    assert 0.9 * LIMITS.most < moved[-1] <= LIMITS.most + 1e-9
    assert moved[10] == pytest.approx(0.01, abs=CLOSE)


@pytest.mark.parametrize("off_plan", [0.0, 0.045, 0.055, 0.2])
def test_after_a_large_deviation_the_arm_stays_in_its_planned_pose(off_plan: float) -> None:
    plan = plan_of(np.random.default_rng(4))
    estimate = pushed_within_the_arms_plane(plan, 0.01, 0.0, 0.0)
    q_arm, rates = compensated_joints(AIRFRAME, LIMITS, JOINTS, off_plan, estimate, plan)
    held, idle = planned_end_effector(plan), reached(estimate, plan.q_arm)
    share = np.linalg.norm(reached(estimate, q_arm) - idle) / np.linalg.norm(np.array(held) - idle)
    expected = {0.0: 1.0, 0.045: 0.5}.get(off_plan, 0.0)
    assert share == pytest.approx(expected, abs=1e-4)
    if expected == 0.0:
        assert rates == pytest.approx(plan.qd_arm)


def test_a_deviation_is_remembered_at_once_and_forgotten_slowly() -> None:
    plan = plan_of(np.random.default_rng(4))
    near = pushed_within_the_arms_plane(plan, 0.01, 0.0, 0.0)
    far = pushed_within_the_arms_plane(plan, 0.1, 0.0, 0.0)
    assert lately_off_plan(LIMITS, 0.0, far, plan, 0.002) == pytest.approx(0.1)
    off = 0.1
    for _ in range(round(LIMITS.memory / 0.002)):
        off = lately_off_plan(LIMITS, off, near, plan, 0.002)
    assert off == pytest.approx(0.1 / math.e, rel=0.01)
    for _ in range(round(3.0 * LIMITS.memory / 0.002)):
        off = lately_off_plan(LIMITS, off, near, plan, 0.002)
    assert off == pytest.approx(0.01)


@pytest.mark.parametrize("seed", range(5))
def test_rates_feel_every_turn_of_a_base_that_is_pushed_sideways(seed: int) -> None:
    random = np.random.default_rng(seed)
    plan = plan_of(random)._replace(j=(0.0, 0.0), yaw_rate=0.0)
    pushed = pushed_within_the_arms_plane(plan, 0.01, -0.01, 0.02)
    R_WB = Rotation.from_matrix(np.reshape(pushed.R_WB, (3, 3)))
    aside = vec3(np.array(pushed.p_WB) + R_WB.apply([0.0, 0.04, 0.0]))
    estimate = pushed._replace(p_WB=aside, w_WB_B=(0.6, 0.2, -0.9))
    _, rates = compensated_joints(AIRFRAME, LIMITS, JOINTS, 0.0, estimate, plan)
    moment = 1e-5
    angles = [later(plan, estimate, t) for t in (-moment, moment)]
    expected = (np.array(angles[1]) - np.array(angles[0])) / (2.0 * moment)
    np.testing.assert_allclose(rates, expected, atol=SLOW)
