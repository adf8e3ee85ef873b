"""Mission segments: smooth, within their limits, and as fast as these allow."""

from __future__ import annotations

import itertools
import math

from hypothesis import assume, given
from hypothesis import strategies as st

from fsw.autopilot.flight.mission.trajectory_segment import (
    MotionLimits,
    TrajectorySegment,
    braking_segment,
    segment_to,
)
from fsw.autopilot.geometry.rotation import wrap_angle
from fsw.autopilot.signals import EndEffectorTarget, Vec3

PACE = MotionLimits(speed=0.3, acceleration=0.05, turn_rate=0.2, turn_acceleration=0.05)
REST = (0.0, 0.0, 0.0)
coordinate = st.floats(-20.0, 20.0)
place = st.tuples(coordinate, coordinate, coordinate)
angle = st.floats(-math.pi, math.pi)


def at_rest(p: Vec3, yaw: float = 0.0, t_us: int = 1_000_000) -> EndEffectorTarget:
    return EndEffectorTarget(t_us, p, REST, REST, yaw)


def samples(segment: TrajectorySegment, count: int = 400) -> list[EndEffectorTarget]:
    before, after = segment.start_us - 100_000, segment.end_us + 100_000
    return [segment.at(before + (after - before) * k // count) for k in range(count + 1)]


@given(place, place, angle, angle)
def test_a_leg_stays_within_its_pace_and_joins_rest_to_rest(
    start: Vec3, end: Vec3, yaw: float, new_yaw: float
) -> None:
    segment = segment_to(at_rest(start, yaw), end, new_yaw, PACE)
    for point in samples(segment):
        assert math.hypot(*point.v_WE) <= PACE.speed * (1.0 + 1e-9)
        assert math.hypot(*point.a_WE) <= PACE.acceleration * (1.0 + 1e-9)
    first, last = segment.at(segment.start_us), segment.at(segment.end_us)
    assert math.dist(first.p_WE, start) < 1e-9
    assert math.dist(last.p_WE, end) < 1e-9
    assert abs(wrap_angle(last.yaw - new_yaw)) < 1e-9
    assert first.v_WE == REST
    assert math.hypot(*last.v_WE) < 1e-12


@given(place, place, angle, angle)
def test_the_derivatives_of_a_leg_are_those_of_its_position(
    start: Vec3, end: Vec3, yaw: float, new_yaw: float
) -> None:
    segment = segment_to(at_rest(start, yaw), end, new_yaw, PACE)
    step = 1_000  # us
    assume(segment.end_us - segment.start_us > 100 * step or start == end)  # or it is too long
    for k in range(1, 40):
        t_us = segment.start_us + (segment.end_us - segment.start_us) * k // 40
        before, now, after = segment.at(t_us - step), segment.at(t_us), segment.at(t_us + step)
        for axis in range(3):
            v = (after.p_WE[axis] - before.p_WE[axis]) / (2e-6 * step)
            a = (after.v_WE[axis] - before.v_WE[axis]) / (2e-6 * step)
            assert abs(v - now.v_WE[axis]) < 1e-6
            assert abs(a - now.a_WE[axis]) < 2e-4
        turned = wrap_angle(after.yaw - before.yaw) / (2e-6 * step)
        assert abs(turned) <= PACE.turn_rate * 1.001


def test_acceleration_is_continuous_where_the_speed_is_reached() -> None:
    segment = segment_to(at_rest(REST), (20.0, 0.0, 0.0), None, PACE)
    assert segment.cruise > 0.0
    points = [
        segment.at(t) for t in range(segment.start_us - 10_000, segment.end_us + 10_000, 10_000)
    ]
    jumps = [abs(b.a_WE[0] - a.a_WE[0]) for a, b in itertools.pairwise(points)]
    assert max(jumps) < 1e-3


def test_a_long_leg_cruises_at_its_speed_and_a_short_one_uses_its_acceleration() -> None:
    long = segment_to(at_rest(REST), (20.0, 0.0, 0.0), None, PACE)
    assert max(p.v_WE[0] for p in samples(long)) > 0.999 * PACE.speed
    short = segment_to(at_rest(REST), (0.5, 0.0, 0.0), None, PACE)
    assert short.cruise == 0.0
    assert max(p.a_WE[0] for p in samples(short, 4000)) > 0.999 * PACE.acceleration


def test_a_leg_turns_the_short_way_and_without_a_heading_not_at_all() -> None:
    segment = segment_to(at_rest(REST, 3.0), REST, -3.0, PACE)
    assert abs(segment.turn - (2.0 * math.pi - 6.0)) < 1e-9
    assert segment_to(at_rest(REST, 1.0), (1.0, 0.0, 0.0), None, PACE).at(9_000_000).yaw == 1.0


def test_a_segment_to_where_it_starts_takes_no_time() -> None:
    segment = segment_to(at_rest((1.0, 2.0, -3.0), 0.4), (1.0, 2.0, -3.0), None, PACE)
    assert segment.end_us == segment.start_us
    assert segment.at(segment.start_us + 5).p_WE == (1.0, 2.0, -3.0)


@given(place, place, st.floats(0.0, 1.0))
def test_braking_goes_straight_on_and_stops_within_its_acceleration(
    start: Vec3, end: Vec3, share: float
) -> None:
    segment = segment_to(at_rest(start), end, None, PACE)
    moving = segment.at(segment.start_us + round(share * (segment.end_us - segment.start_us)))
    stop = braking_segment(moving, PACE)
    first, last = stop.at(moving.t_us), stop.at(stop.end_us)
    assert math.dist(first.p_WE, moving.p_WE) < 1e-9
    assert math.dist(first.v_WE, moving.v_WE) < 1e-9
    assert last.v_WE == REST
    for point in samples(stop):
        assert math.hypot(*point.a_WE) <= PACE.acceleration * (1.0 + 1e-9)
