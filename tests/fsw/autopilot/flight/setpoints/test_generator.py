"""The generated setpoint: within limits, to its goal, clear of the walls."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.barriers.safe_approach import BarrierTuning, safe_approach_speed
from fsw.autopilot.flight.setpoints.generator import (
    PositionGoal,
    ReferenceState,
    SetpointGenerator,
    arrived,
    step,
)
from fsw.autopilot.flight.setpoints.reference_governor import (
    limit_approach,
    limit_descent,
    limit_lead,
)
from fsw.autopilot.model.body import NO_HULL
from fsw.autopilot.parameters.flight_config import SetpointLimits, flight_config
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import MotionSetpoint, SafeSet, Vec3
from tests.fsw.autopilot.flight.in_flight import CONFIG, vehicle_at

LIMITS = SetpointLimits()
STILL = ReferenceState(False, (0.0, 0.0, -2.0), (0.0, 0.0, 0.0), 0.0, 0.0, (0.0, 0.0))
WALL = SafeSet((wall((-1.0, 0.0, 0.0), -3.0, 0.1),))
BARRIER = BarrierTuning(alpha=2.0, slope=4.0)
NAN = math.nan
number = st.floats(-30.0, 30.0)
vector = st.tuples(number, number, number)


def run(lead: ReferenceState, aim: PositionGoal, seconds: float) -> list[ReferenceState]:
    path = [lead]
    for _ in range(round(10 * seconds)):
        path.append(step(path[-1], aim, LIMITS, 0.1))
    return path


def test_it_reaches_a_place_and_rests_there_without_passing_it() -> None:
    goal = (4.0, -3.0, -2.0)
    path = run(STILL, PositionGoal(MotionSetpoint(False, p=goal, yaw=1.0)), 25.0)
    assert arrived(path[-1], goal)
    assert path[-1].yaw == pytest.approx(1.0, abs=0.01)
    assert max(math.hypot(*lead.v) for lead in path) <= LIMITS.cruise_speed + 1e-9
    left = [math.dist(lead.p, goal) for lead in path]
    assert all(after <= before + 1e-3 for before, after in itertools.pairwise(left))


def test_a_goto_may_be_slower_but_not_faster_than_allowed() -> None:
    aim = PositionGoal(MotionSetpoint(False, p=(50.0, 0.0, -2.0)), speed=0.25)
    assert max(math.hypot(*lead.v) for lead in run(STILL, aim, 5.0)) <= 0.25 + 1e-9
    hasty = replace(aim, speed=50.0)
    fastest = max(math.hypot(*lead.v) for lead in run(STILL, hasty, 9.0))
    assert fastest == pytest.approx(LIMITS.speed)


def test_a_velocity_is_taken_up_at_the_allowed_acceleration() -> None:
    path = run(STILL, PositionGoal(MotionSetpoint(False, v=(1.0, 0.0, 0.0))), 2.0)
    assert path[1].v[0] == pytest.approx(0.1 * LIMITS.acceleration)
    assert path[-1].v == pytest.approx((1.0, 0.0, 0.0))


def test_each_axis_follows_its_own_position_velocity_or_acceleration() -> None:
    held = MotionSetpoint(False, p=(NAN, NAN, -3.0), v=(0.5, -0.25, NAN))
    path = run(STILL, PositionGoal(held), 20.0)
    assert path[-1].p[2] == pytest.approx(-3.0, abs=0.02)
    assert path[-1].v == pytest.approx((0.5, -0.25, 0.0), abs=0.01)
    pushed = MotionSetpoint(False, p=(NAN, 0.0, NAN), v=(NAN, NAN, 0.1), a=(0.2, NAN, NAN))
    end = run(STILL, PositionGoal(pushed), 2.0)[-1]
    assert end.v[0] == pytest.approx(0.4, abs=0.01)
    assert end.v[2] == pytest.approx(0.1)
    assert end.p[1] == 0.0


def test_a_velocity_along_the_heading_turns_with_it() -> None:
    east = replace(STILL, yaw=0.5 * math.pi)
    aim = PositionGoal(MotionSetpoint(False, v=(1.0, 0.0, 0.0), along_heading=True))
    assert run(east, aim, 2.0)[-1].v == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)


def test_forward_and_right_are_seen_from_the_vehicle_and_down_stays_down() -> None:
    turned = replace(STILL, yaw=0.5)
    aim = PositionGoal(MotionSetpoint(False, v=(0.3, 0.4, 0.2), along_heading=True))
    vx, vy, vz = run(turned, aim, 2.0)[-1].v
    assert math.hypot(vx, vy) == pytest.approx(0.5)
    assert math.atan2(vy, vx) == pytest.approx(0.5 + math.atan2(0.4, 0.3))
    assert vz == pytest.approx(0.2)


@pytest.mark.parametrize("of_end_effector", [True, False])
def test_without_joints_the_point_itself_is_the_target(of_end_effector: bool) -> None:
    free = replace(STILL, of_end_effector=of_end_effector, q_arm=None, v=(0.1, 0.2, 0.3), yaw=0.4)
    target = SetpointGenerator(flight_config(body="points")).target(free, 5)
    assert (target.t_us, target.p_WE, target.v_WE, target.yaw) == (5, free.p, free.v, 0.4)


def test_an_acceleration_adds_up_to_the_largest_speed() -> None:
    path = run(STILL, PositionGoal(MotionSetpoint(False, a=(0.5, 0.0, 0.0))), 1.0)
    assert path[-1].v[0] == pytest.approx(0.5)
    assert run(STILL, PositionGoal(MotionSetpoint(False, a=(20.0, 0.0, 0.0))), 5.0)[-1].v[0] == (
        pytest.approx(LIMITS.speed)
    )


def test_the_short_way_round_and_joints_at_their_speed() -> None:
    turned = replace(STILL, yaw=3.0)
    aim = PositionGoal(MotionSetpoint(False, v=(0.0, 0.0, 0.0), yaw=-3.0), joints=(0.5, -0.02))
    path = run(turned, aim, 10.0)
    assert min(abs(lead.yaw) for lead in path) > 2.9
    assert path[-1].yaw == pytest.approx(-3.0, abs=0.01)
    assert path[1].q_arm == pytest.approx((0.1 * LIMITS.joint_speed, -0.02))
    assert path[-1].q_arm == pytest.approx((0.5, -0.02))


@given(vector, vector, vector, st.booleans())
def test_whatever_is_asked_for_speed_and_acceleration_stay_within_limits(
    p: Vec3, v: Vec3, a: Vec3, place: bool
) -> None:
    motion = MotionSetpoint(False, p=p if place else None, v=v, a=a)
    for before, after in itertools.pairwise(run(STILL, PositionGoal(motion), 2.0)):
        assert math.hypot(*after.v) <= LIMITS.speed + 1e-9
        assert math.dist(before.v, after.v) <= 0.1 * LIMITS.acceleration + 1e-9


def limited(
    lead: ReferenceState, other_end: Vec3, safe_set: SafeSet, barrier: BarrierTuning
) -> ReferenceState:
    ends, hulls = ((0.0, 0.0, 0.0), other_end), (NO_HULL, NO_HULL)
    p, v = limit_approach(lead.p, lead.v, ends, hulls, safe_set, 0, barrier)
    return replace(lead, p=p, v=v)


def lowered(lead: ReferenceState, body_height: float, touch_speed: float) -> ReferenceState:
    p, v = limit_descent(lead.p, lead.v, body_height, touch_speed)
    return replace(lead, p=p, v=v)


def test_the_lead_is_limited() -> None:
    away = replace(STILL, p=(3.0, 4.0, -2.0))
    assert limit_lead(away.p, (0.0, 0.0, -2.0), 0.5) == pytest.approx((0.3, 0.4, -2.0))
    near = replace(STILL, p=(0.1, 0.0, -2.0))
    assert limit_lead(near.p, (0.0, 0.0, -2.0), 0.5) is near.p


def test_the_point_stays_within_the_configured_distance_of_the_vehicle() -> None:
    away, here = (8.0, 0.0, -2.0), vehicle_at((0.0, 0.0, -2.0))
    ahead = ReferenceState(False, away, (0.0, 0.0, 0.0), 0.0)
    goal = PositionGoal(MotionSetpoint(False, p=away))
    moved = SetpointGenerator(CONFIG).advance(ahead, goal, here, SafeSet())
    assert moved.p == pytest.approx((CONFIG.steering.max_lead_distance, 0.0, -2.0))


@given(number, st.floats(-3.0, 3.0), st.floats(-0.3, 0.3))
def test_no_end_of_the_arm_is_wanted_in_a_wall_and_the_approach_can_stop(
    x: float, speed: float, reach: float
) -> None:
    lead = replace(STILL, p=(x, 0.0, -2.0), v=(speed, 0.0, 0.0))
    kept = limited(lead, (reach, 0.0, 0.3), WALL, BARRIER)
    room = 2.9 - max(kept.p[0], kept.p[0] + reach)
    assert room >= -1e-9
    assert kept.v[0] <= safe_approach_speed(max(room, 0.0), 2.0, 4.0) + 1e-9
    assert kept.v[0] <= max(speed, 0.0) + 1e-9 or speed < 0.0


@given(number, number, st.floats(-3.0, 3.0))
def test_what_hangs_below_is_not_wanted_near_a_point_and_the_approach_can_stop(
    x: float, y: float, speed: float
) -> None:
    branch, below = point((0.5, 0.0, -2.0), 0.2), (0.0, 0.0, 0.3)
    lead = replace(STILL, p=(x, y, -2.2), v=(speed, -speed, 0.0))
    kept = limited(lead, below, SafeSet((branch,)), BARRIER)
    end = (kept.p[0], kept.p[1], kept.p[2] + 0.3)
    away = [a - b for a, b in zip(end, (0.5, 0.0, -2.0), strict=True)]
    distance = math.hypot(*away)
    assert distance >= 0.2 - 1e-9
    approach = -sum(a * v for a, v in zip(away, kept.v, strict=True)) / distance
    assert approach <= safe_approach_speed(max(distance - 0.2, 0.0), 2.0, 4.0) + 1e-9


def test_the_body_is_not_wanted_near_a_point_that_its_arm_is_far_from() -> None:
    branch, below = point((0.1, 0.0, -2.0), 0.2), (0.0, 0.0, 5.0)
    kept = limited(STILL, below, SafeSet((branch,)), BARRIER)
    assert kept.p == pytest.approx((-0.1, 0.0, -2.0))


def test_away_from_walls_nothing_changes() -> None:
    lead = replace(STILL, v=(1.0, 0.5, 0.0))
    assert limited(lead, (0.0, 0.0, 0.3), WALL, BARRIER) == lead


def test_near_the_ground_it_sinks_as_slowly_as_a_landing_and_hardly_slides() -> None:
    falling = replace(STILL, v=(1.0, 0.0, 2.0))
    assert lowered(falling, 10.0, 0.25).v == falling.v
    low = lowered(falling, 0.0, 0.25)
    assert low.v[2] == 0.25
    assert math.hypot(low.v[0], low.v[1]) <= 0.1
    rising = replace(STILL, v=(0.0, 0.0, -1.0))
    assert lowered(rising, 0.0, 0.25).v[2] == -1.0


def test_an_end_effector_is_not_pressed_on_the_ground() -> None:
    lead = replace(STILL, p=(0.0, 0.0, -0.1), v=(0.0, 0.0, 1.0))
    kept = lowered(lead, -0.2, 0.0)
    assert kept.p[2] == pytest.approx(-0.4)
    assert kept.v[2] == 0.0
