"""A circle that is followed from anywhere, and a heading that follows a place."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fsw.autopilot.flight.setpoints.generator import (
    PositionGoal,
    ReferenceState,
    looking_at,
    max_orbit_speed,
    on_orbit,
    step,
)
from fsw.autopilot.parameters.flight_config import SetpointLimits
from fsw.autopilot.signals import Facing, MotionSetpoint, Orbit

ORBIT = Orbit((3.0, -2.0, -1.5), 2.0, 0.4)
places = st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(-10.0, -0.5))


@example(p=ORBIT.centre, clockwise=True)
@given(places, st.booleans())
def test_from_anywhere_the_nearest_point_of_the_circle_is_the_target(
    p: tuple[float, float, float], clockwise: bool
) -> None:
    motion = on_orbit(replace(ORBIT, clockwise=clockwise), p)
    assert motion.p is not None
    assert motion.v is not None
    assert math.dist(motion.p[:2], ORBIT.centre[:2]) == pytest.approx(ORBIT.radius)
    assert motion.p[2] == ORBIT.centre[2]
    assert math.hypot(*motion.v) == pytest.approx(ORBIT.speed)
    radial = [a - b for a, b in zip(motion.p[:2], ORBIT.centre[:2], strict=True)]
    assert sum(a * b for a, b in zip(radial, motion.v[:2], strict=True)) == pytest.approx(0.0)
    # Seen from above with north up and east to the right, clockwise turns north towards east.
    turn = radial[0] * motion.v[1] - radial[1] * motion.v[0]
    assert (turn > 0.0) is clockwise
    distance = math.dist(p[:2], ORBIT.centre[:2])
    if distance > 0.1:
        assert math.dist(motion.p[:2], p[:2]) == pytest.approx(abs(distance - ORBIT.radius))


def flown(lead: ReferenceState, aim: PositionGoal, seconds: float) -> list[ReferenceState]:
    leads = [lead]
    for _ in range(round(10.0 * seconds)):
        leads.append(step(leads[-1], aim, SetpointLimits(), 0.1))
    return leads


@pytest.mark.parametrize("clockwise", [True, False])
def test_a_reference_comes_to_the_circle_and_goes_round(clockwise: bool) -> None:
    orbit = replace(ORBIT, clockwise=clockwise)
    aim = PositionGoal(MotionSetpoint(False, orbit.centre), orbit=orbit)
    track = flown(ReferenceState(False, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 0.0), aim, 120.0)[300:]
    for lead in track:
        assert math.dist(lead.p[:2], orbit.centre[:2]) == pytest.approx(orbit.radius, abs=0.05)
        assert lead.p[2] == pytest.approx(orbit.centre[2], abs=0.01)
        bearing = math.atan2(orbit.centre[1] - lead.p[1], orbit.centre[0] - lead.p[0])
        assert math.cos(lead.yaw - bearing) > math.cos(0.1), "the nose points to the centre"
    angles = [math.atan2(at.p[1] - orbit.centre[1], at.p[0] - orbit.centre[0]) for at in track]
    turned = sum(math.remainder(b - a, 2.0 * math.pi) for a, b in itertools.pairwise(angles))
    expected = 90.0 * orbit.speed / orbit.radius
    assert turned == pytest.approx(expected if clockwise else -expected, rel=0.03)


@given(st.floats(-20.0, 20.0), st.floats(0.2, 1.5), st.floats(0.2, 1.5))
@settings(max_examples=25)
def test_the_way_to_a_circle_is_no_faster_than_the_speed_that_was_set(
    x: float, cruise: float, speed: float
) -> None:
    orbit = replace(ORBIT, speed=speed)
    aim = PositionGoal(MotionSetpoint(False, orbit.centre, yaw=0.0), speed=cruise, orbit=orbit)
    track = flown(ReferenceState(False, (x, -2.0, -8.0), (0.0, 0.0, 0.0), 0.0), aim, 20.0)
    assert max(math.hypot(*lead.v) for lead in track) <= max(cruise, speed) + 1e-9


@pytest.mark.parametrize(
    ("facing", "offset"), [(Facing.TANGENT, math.pi / 2.0), (Facing.INITIAL, None)]
)
def test_where_the_nose_points(facing: Facing, offset: float | None) -> None:
    orbit = replace(ORBIT, facing=facing)
    aim = PositionGoal(MotionSetpoint(False, orbit.centre, yaw=0.5), orbit=orbit)
    last = flown(ReferenceState(False, (5.0, -2.0, -1.5), (0.0, 0.0, 0.0), 0.5), aim, 60.0)[-1]
    outward = math.atan2(last.p[1] - orbit.centre[1], last.p[0] - orbit.centre[0])
    expected = 0.5 if offset is None else outward + offset
    assert math.cos(last.yaw - expected) > math.cos(0.1)


def test_a_place_is_looked_at_from_a_point_that_moves() -> None:
    aim = PositionGoal(MotionSetpoint(False, (8.0, 0.0, -1.0)), look_at=(4.0, 3.0, 0.0))
    track = flown(ReferenceState(False, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 0.6435), aim, 20.0)
    for lead in track:
        bearing = math.atan2(3.0 - lead.p[1], 4.0 - lead.p[0])
        assert math.cos(lead.yaw - bearing) > math.cos(0.5)  # as fast as it may turn
    last = track[-1]
    assert last.yaw == pytest.approx(math.atan2(3.0, -4.0), abs=0.05)


def test_right_over_a_place_the_heading_is_left_as_it_is() -> None:
    motion = MotionSetpoint(False, (1.0, 0.0, -1.0), yaw=0.7)
    assert looking_at(motion, (0.1, 0.1, 0.0), (0.0, 0.0, -1.0), (0.3, 0.0, 0.0)) is motion


@given(st.floats(0.5, 100.0))
def test_no_circle_is_flown_faster_than_the_nose_can_turn_or_the_reference_accelerate(
    radius: float,
) -> None:
    limits = SetpointLimits()
    v = max_orbit_speed(radius, limits.yaw_rate, limits.acceleration)
    assert v / radius < limits.yaw_rate
    assert v * v / radius < limits.acceleration
