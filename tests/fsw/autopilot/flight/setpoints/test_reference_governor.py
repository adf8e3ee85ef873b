"""A streamed trajectory is unchanged unless it is far from the vehicle or unsafe."""

from __future__ import annotations

import math
from dataclasses import replace
from time import perf_counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.flight.setpoints.reference_governor import (
    ReferenceGovernor,
    project,
    project_to_safe_set,
)
from fsw.autopilot.parameters.flight_config import flight_config, lowest_height
from fsw.autopilot.shapes.ball import ball, point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.zones import surface
from fsw.autopilot.signals import EndEffectorTarget, MotionSetpoint, SafeSet, Vec3, Zone
from fsw.compiled import IN_PYTHON

WALL = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1),))
STILL: Vec3 = (0.0, 0.0, 0.0)
CONFIG = flight_config(body="points")
GOVERNOR = ReferenceGovernor(CONFIG)
LIMITS = GOVERNOR.limits_from()  # of targets from outside


def horizon(first: Vec3, v: Vec3 = STILL) -> tuple[EndEffectorTarget, ...]:
    return tuple(
        EndEffectorTarget(
            100_000 * k,
            (first[0] + 0.1 * k * v[0], first[1] + 0.1 * k * v[1], first[2] + 0.1 * k * v[2]),
            v,
            STILL,
        )
        for k in range(6)
    )


def kept(
    targets: tuple[EndEffectorTarget, ...], p_WE: Vec3, v_WE: Vec3 = STILL
) -> tuple[EndEffectorTarget, ...]:
    return GOVERNOR.limit_horizon(targets, p_WE, v_WE, WALL)[0]


def test_the_paper_s_path_into_the_safety_zone_passes_untouched() -> None:
    targets = horizon((0.93, 0.0, -1.2), (0.1, 0.05, 0.0))
    assert kept(targets, (0.82, 0.0, -1.2)) is targets


def test_a_target_far_away_is_brought_near_and_no_node_jumps() -> None:
    near = kept(horizon((-3.0, 4.0, -1.0), (0.0, 0.5, 0.0)), (0.0, 0.0, -1.0))
    assert near[0].p_WE == pytest.approx((-0.24, 0.32, -1.0))
    assert math.dist(near[-1].p_WE, (0.0, 0.0, -1.0)) == pytest.approx(0.6)
    here = horizon((0.0, 0.0, -1.0))
    jumps = (*here[:3], *horizon((-2.0, 0.0, -1.0))[3:])
    near = kept(jumps, (0.0, 0.0, -1.0))
    assert max(math.dist(target.p_WE, (0.0, 0.0, -1.0)) for target in near) < 0.61


def test_a_vehicle_in_motion_may_be_asked_for_what_its_motion_leads_to() -> None:
    targets = horizon((-2.0, 0.0, -1.0), (0.0, 2.0, 0.0))
    assert kept(targets, (-2.0, 0.0, -1.0), (0.0, 1.8, 0.0)) is targets
    slower = kept(targets, (-2.0, 0.0, -1.0))
    assert slower[0].v_WE == pytest.approx((0.0, 1.0, 0.0))


@given(st.floats(-3.0, 0.9), st.floats(-5.0, 5.0), st.floats(-10.0, 10.0))
def test_nothing_pulls_deep_or_fast_into_a_wall(x: float, v: float, first: float) -> None:
    for target in kept(horizon((first, 0.0, -1.2), (v, 0.0, 0.0)), (x, 0.0, -1.2)):
        assert target.p_WE[0] <= 1.0 + 1e-9
        room = 0.9 - x
        assert target.v_WE[0] <= max((4.0 * room) ** 0.5, 4.0 * room, 0.5) + 1e-9
        assert abs(target.v_WE[0]) <= 1.0 + 1e-9


BRANCH = SafeSet((point((1.0, 0.0, -1.2), 0.3),))


def test_a_path_that_passes_a_point_within_its_clearance_stays_as_it_is() -> None:
    targets = horizon((1.0, 0.25, -1.2), (0.3, 0.0, 0.0))
    assert GOVERNOR.limit_horizon(targets, (0.9, 0.3, -1.2), STILL, BRANCH)[0] is targets


@given(st.floats(-math.pi, math.pi), st.floats(0.01, 0.3), st.floats(0.5, 3.0))
def test_nothing_pulls_deep_into_the_ball_of_a_point_or_fast_towards_it(
    angle: float, distance: float, speed: float
) -> None:
    away = (math.cos(angle), math.sin(angle), 0.0)
    target = (1.0 + distance * away[0], distance * away[1], -1.2)
    p_WE = (1.0 + 0.35 * away[0], 0.35 * away[1], -1.2)
    inward = (-speed * away[0], -speed * away[1], 0.0)
    targets = (EndEffectorTarget(0, target, inward, STILL),)
    ((limited,), _) = GOVERNOR.limit_horizon(targets, p_WE, STILL, BRANCH)
    assert math.dist(limited.p_WE, (1.0, 0.0, -1.2)) == pytest.approx(max(distance, 0.2))
    assert math.hypot(*limited.v_WE) <= 0.5 + 1e-9


LEGS = CONFIG.airframe.leg_length
NO_WALLS = SafeSet()


def limited(
    p: Vec3, v: Vec3, other_end: Vec3 = (0.0, 0.0, 0.3), *, tip: bool = False,
    safe_set: SafeSet = NO_WALLS,
) -> tuple[Vec3, Vec3]:  # fmt: skip
    return GOVERNOR.limit_setpoint(
        p, v, other_end=other_end, of_end_effector=tip, safe_set=safe_set, t_us=0
    )


@given(st.floats(0.0, 3.0), st.floats(-2.0, 2.0))
def test_a_setpoint_of_the_body_sinks_no_faster_than_braking_at_1_m_s2_allows(
    height: float, sink: float
) -> None:
    _, (_, _, vz) = limited((0.0, 0.0, -LEGS - height), (0.0, 0.0, sink))
    # At the ground the landing speed; above it what stops, linear in the last quarter of a metre.
    stops = 2.0 * height if height < 0.25 else math.sqrt(2.0 * (height - 0.125))
    assert vz == pytest.approx(min(sink, max(stops, CONFIG.limits.land_speed)))


@given(st.floats(-0.2, 3.0), st.floats(-2.0, 2.0))
def test_a_setpoint_of_the_end_effector_keeps_the_body_at_the_lowest_height_of_references(
    height: float, sink: float
) -> None:
    hanging = 0.25
    p, (_, _, vz) = limited(
        (0.0, 0.0, -LEGS - height + hanging), (0.0, 0.0, sink), (0.0, 0.0, -hanging), tip=True
    )
    least = CONFIG.limits.airborne_height
    assert -(p[2] - hanging) - LEGS == pytest.approx(max(height, least))
    room = max(height - least, 0.0)
    stops = 2.0 * room if room < 0.25 else math.sqrt(2.0 * (room - 0.125))
    assert vz == pytest.approx(min(sink, stops), abs=1e-9)


@given(st.floats(0.0, 2.0), st.floats(0.01, 2.0), st.floats(-math.pi, math.pi))
def test_near_the_ground_a_setpoint_hardly_slides(height: float, speed: float, way: float) -> None:
    level = (speed * math.cos(way), speed * math.sin(way), 0.0)
    _, (vx, vy, _) = limited((0.0, 0.0, -LEGS - height), level)
    stops = 2.0 * height if height < 0.25 else math.sqrt(2.0 * (height - 0.125))
    assert math.hypot(vx, vy) == pytest.approx(min(speed, stops + 0.05))
    assert math.cos(math.atan2(vy, vx) - way) == pytest.approx(1.0)


def test_a_setpoint_is_kept_off_walls_and_off_points_whichever_there_is() -> None:
    into = (1.0, 0.0, 0.0)
    for safe_set in (WALL, BRANCH):
        p, v = limited((0.95, 0.0, -1.2), into, safe_set=safe_set)
        assert p[0] < 0.94
        assert v[0] == pytest.approx(0.0, abs=1e-9)
    assert limited((0.95, 0.0, -1.2), into) == ((0.95, 0.0, -1.2), into)


def test_a_horizon_is_limited_with_the_barriers_own_braking() -> None:
    walls = replace(CONFIG.planner.walls, alpha=1.0)
    weaker = ReferenceGovernor(replace(CONFIG, planner=replace(CONFIG.planner, walls=walls)))
    targets, here = horizon((0.8, 0.0, -1.2), (3.0, 0.0, 0.0)), (0.4, 0.0, -1.2)
    faster, slower = (
        one.limit_horizon(targets, here, STILL, WALL)[0][0].v_WE[0] for one in (GOVERNOR, weaker)
    )
    assert 0.0 < slower < faster < 3.0


def test_a_target_beyond_a_wall_rests_at_the_boundary_and_one_inside_goes_on() -> None:
    moving = EndEffectorTarget(5, (0.5, 1.0, -1.0), (1.0, 0.0, 0.0), (0.1, 0.0, 0.0), 0.3)
    assert project(moving, WALL) is moving
    beyond = replace(moving, p_WE=(1.4, 1.0, -1.0))
    assert project(beyond, WALL) == EndEffectorTarget(5, (0.9, 1.0, -1.0), STILL, STILL, 0.3)


@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_a_projected_place_keeps_every_clearance_and_is_the_nearest_of_a_single_wall(
    p: Vec3,
) -> None:
    corner = SafeSet(
        (
            wall((-1.0, 0.0, 0.0), -1.0, 0.1),
            wall((-0.6, -0.8, 0.0), -1.0, 0.1),
            point((-1.0, -1.0, 0.0), 0.4),
        )
    )
    x, y, z = project_to_safe_set(p, corner, 0)
    assert 1.0 - x >= 0.1 - 2e-4
    assert 1.0 - 0.6 * x - 0.8 * y >= 0.1 - 2e-4
    assert math.dist((x, y, z), (-1.0, -1.0, 0.0)) >= 0.4 - 2e-4
    alone = project_to_safe_set(p, WALL, 0)
    # Within the tolerance a place counts as inside.
    assert alone == (p if p[0] <= 0.9 + 1e-4 else pytest.approx((0.9, p[1], p[2])))


HIGHEST, SPEED = CONFIG.steering.highest, CONFIG.steering.speed
LOWEST_TIP = lowest_height(CONFIG) - CONFIG.surroundings.hanging


def streamed(
    first: Vec3, v: Vec3 = STILL, here: Vec3 = (0.0, 0.0, -1.0), moves: Vec3 = STILL
) -> tuple[tuple[EndEffectorTarget, ...], str]:
    return GOVERNOR.limit_horizon(horizon(first, v), here, moves, SafeSet(), LIMITS)


def test_targets_from_outside_pass_between_floor_and_ceiling_at_a_speed_that_may_be_flown() -> None:
    targets = horizon((0.1, 0.0, -1.0), (0.6, -0.8, 0.3))
    moves = (0.5, -0.7, 0.3)
    same = GOVERNOR.limit_horizon(targets, (0.0, 0.0, -1.0), moves, SafeSet(), LIMITS)
    assert same == (targets, "")


@pytest.mark.parametrize(
    ("first", "here", "words"),
    [
        ((0.0, 0.0, 3.2), (0.0, 0.0, -1.0), "below 0.40 m"),
        ((0.0, 0.0, -125.0), (0.0, 0.0, -119.7), "above 120 m"),
        ((0.0, 0.0, -11.0), (0.0, 0.0, -1.0), "more than 1 m ahead"),
    ],
)
def test_targets_from_outside_that_leave_them_are_limited_and_the_limit_named(
    first: Vec3, here: Vec3, words: str
) -> None:
    near, why = streamed(first, here=here)
    assert words in why
    for target in near:
        height = -target.p_WE[2]
        assert LOWEST_TIP - 1e-9 <= height <= HIGHEST - CONFIG.surroundings.hanging + 1e-9


@given(st.floats(0.0, 4.0), st.floats(-math.pi, math.pi), st.floats(0.0, 1.0))
def test_a_vehicle_at_the_largest_speed_is_led_no_faster(
    speed: float, way: float, target_speed: float
) -> None:
    """However far away targets are: those of a moving vehicle used to run ahead of it for ever."""
    ahead = (math.cos(way), math.sin(way), 0.0)
    moves = (speed * ahead[0], speed * ahead[1], 0.0)
    v = (20.0 * target_speed * ahead[0], 20.0 * target_speed * ahead[1], 0.0)
    near, why = streamed((50.0 * ahead[0], 50.0 * ahead[1], -1.0), v, moves=moves)
    assert "more than" in why
    last = near[-1]
    reach = SPEED * 0.5 + max(0.4 * (1.0 - speed / SPEED), 0.1)
    assert math.dist(last.p_WE, (0.0, 0.0, -1.0)) <= reach + 1e-9
    assert math.hypot(*last.v_WE) <= max(SPEED, speed - 1.0) + 1e-9


def test_near_the_lowest_height_targets_sink_as_fast_as_braking_allows() -> None:
    near, _ = streamed((0.0, 0.0, -0.5), (0.0, 0.0, 1.0), here=(0.0, 0.0, -0.5))
    room = 0.5 - LOWEST_TIP
    assert near[0].v_WE[2] == pytest.approx(2.0 * room)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (MotionSetpoint(False, (0.0, 0.0, -1.0)), ""),
        (MotionSetpoint(False, (0.0, 0.0, 0.5)), ""),  # a body is asked to land
        (MotionSetpoint(True, (0.0, 0.0, 0.5)), "below"),
        (MotionSetpoint(False, (0.0, 0.0, -120.5)), "above 120 m"),
        (MotionSetpoint(False, v=(1.2, 1.2, 0.0)), "more than 1.5 m/s"),
    ],
)
def test_a_setpoint_is_held_against_the_same_limits(motion: MotionSetpoint, words: str) -> None:
    left = GOVERNOR.left_by(motion)
    assert words in left if words else left == ""


def test_a_setpoint_goes_no_higher_than_the_highest_height() -> None:
    (_, _, z), (_, _, vz) = limited((0.0, 0.0, -HIGHEST - 3.0), (0.0, 0.0, -1.0))
    assert (z, vz) == (pytest.approx(-HIGHEST), 0.0)


@pytest.mark.skipif(IN_PYTHON, reason="kernels as Python are as slow as it")
def test_a_reference_among_sixty_four_zones_costs_little_more_than_beside_one() -> None:
    """The hash of the set, once a zone, and Python made it 70 times as much: late ticks."""
    governor = ReferenceGovernor(flight_config(body="full"))
    near = tuple(Zone(ball((1.5 + 0.1 * k, 0.0, -1.0), 0.2), 0.1) for k in range(64))

    def seconds(zones: tuple[Zone, ...]) -> float:
        safe_set, took = SafeSet(zones), []
        for _ in range(30):
            begin = perf_counter()
            governor.limit_setpoint(
                *((0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
                other_end=(0.0, 0.0, 0.2),
                of_end_effector=False,
                safe_set=safe_set,
                t_us=0,
            )
            project_to_safe_set((0.0, 0.0, -1.0), safe_set, 0)
            surface(safe_set, 0, (0.0, 0.0, -1.0), 0)
            took.append(perf_counter() - begin)
        return min(took)

    assert seconds(near) < 10.0 * seconds(near[:1])
