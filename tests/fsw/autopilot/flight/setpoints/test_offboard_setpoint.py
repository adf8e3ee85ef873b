"""Which setpoints are in range, and that attitude and thrust become the acceleration they make."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.autopilot.flight.commands.bounds import motion_refusal
from fsw.autopilot.flight.setpoints.offboard_setpoint import (
    Tilt,
    as_motion,
    attitude_refusal,
    joints_refusal,
    tilted,
)
from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY
from fsw.autopilot.signals import MAX_DISTANCE, AttitudeSetpoint, MotionSetpoint, Vec2
from tests.fsw.paper_arm import LIMIT1, LIMIT12

angles = st.floats(-1.2, 1.2)
turns = st.floats(-3.1, 3.1)


@given(angles, angles, turns, st.floats(0.0, 30.0))
def test_an_attitude_and_a_thrust_are_the_acceleration_of_a_body_that_has_them(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    motion = as_motion(Tilt(roll, pitch, yaw), thrust)
    up = Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply([0.0, 0.0, -1.0])
    assert motion.a == pytest.approx(tuple(thrust * up + [0.0, 0.0, GRAVITY]), abs=1e-9)
    assert (motion.yaw, motion.of_end_effector, motion.p, motion.v) == (yaw, False, None, None)


@given(angles, angles, turns)
def test_a_quaternion_is_taken_as_it_is(roll: float, pitch: float, yaw: float) -> None:
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    setpoint = AttitudeSetpoint(0.5, (float(w), float(x), float(y), float(z)), (1.0, 1.0, 1.0))
    got = tilted(setpoint, Tilt(), 2.0, 0.1)
    assert (got.roll, got.pitch, got.yaw) == pytest.approx((roll, pitch, yaw), abs=1e-9)


@given(angles, angles, turns, st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_body_rates_turn_the_attitude_of_last_time(
    roll: float, pitch: float, yaw: float, rates: tuple[float, float, float]
) -> None:
    moment = 1e-5
    got = tilted(AttitudeSetpoint(0.5, None, rates), Tilt(roll, pitch, yaw), 2.0, moment)
    before = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    after = before * Rotation.from_rotvec(moment * np.array(rates))
    expected = after.as_euler("ZYX")[::-1]
    assert (got.roll, got.pitch, got.yaw) == pytest.approx(tuple(expected), abs=1e-8)


def test_neither_attitude_nor_rates_leaves_the_attitude() -> None:
    last = Tilt(0.1, -0.2, 0.3)
    assert tilted(AttitudeSetpoint(0.5, None, None), last, 0.5, 0.1) == last


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_no_tilt_beyond_the_flown_one_is_asked_for(sign: float) -> None:
    q = Rotation.from_euler("ZYX", [3.0, 0.9 * sign, -0.8 * sign]).as_quat()
    quaternion = (float(q[3]), float(q[0]), float(q[1]), float(q[2]))
    got = tilted(AttitudeSetpoint(0.5, quaternion, None), Tilt(), 0.3, 0.1)
    assert (got.roll, got.pitch) == (-0.3 * sign, 0.3 * sign)
    assert got.yaw == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("name", "most", "words"),
    [("p", MAX_DISTANCE, "position"), ("v", 20.0, "velocity"), ("a", 20.0, "acceleration")],
)
def test_a_motion_is_refused_beyond_its_range_in_any_direction(
    name: str, most: float, words: str
) -> None:
    for share, refused in ((0.999, False), (1.001, True), (math.nan, True), (math.inf, True)):
        for vector in ((1.0, 0.0, 0.0), (0.0, -0.6, 0.8), (-0.6, 0.0, -0.8)):
            value = tuple(c * share * most if c else 0.0 for c in vector)
            setpoint = MotionSetpoint(False, **{name: value})  # type: ignore[arg-type]
            reported = motion_refusal(setpoint)
            assert (reported is None) is not refused
            if reported is not None and not math.isnan(share):
                assert reported.startswith(f"{words} out of range: ")
                assert f"at most {most:g} m" in reported


def test_an_axis_that_every_vector_leaves_open_is_named() -> None:
    held = MotionSetpoint(False, p=(math.nan, math.nan, -2.0), v=(0.5, 0.1, math.nan))
    assert motion_refusal(held) is None
    for p, v, axis in (
        ((math.nan, math.nan, -2.0), (0.5, math.nan, 0.0), "east"),
        ((math.nan, 1.0, math.nan), (0.5, 0.0, math.nan), "down"),
        ((math.nan, 1.0, 1.0), None, "north"),
    ):
        reported = motion_refusal(MotionSetpoint(False, p=p, v=v))
        assert reported == f"{axis} has no position, velocity or acceleration"


@pytest.mark.parametrize(("name", "most"), [("yaw", 4.0 * math.pi), ("yaw_rate", 10.0)])
def test_a_heading_is_refused_beyond_its_range_either_way(name: str, most: float) -> None:
    for sign in (-1.0, 1.0):
        for value, refused in ((0.99 * most, False), (1.01 * most, True), (math.nan, True)):
            setpoint = MotionSetpoint(False, **{name: sign * value})  # type: ignore[arg-type]
            assert (motion_refusal(setpoint) is not None) is refused
    assert motion_refusal(MotionSetpoint(False)) is None


@pytest.mark.parametrize(
    ("setpoint", "words"),
    [
        (AttitudeSetpoint(0.0), None),
        (AttitudeSetpoint(1.0), None),
        (AttitudeSetpoint(-0.01), "thrust"),
        (AttitudeSetpoint(1.01), "thrust"),
        (AttitudeSetpoint(math.nan), "thrust"),
        (AttitudeSetpoint(0.5, (0.995, 0.0, 0.0, 0.0)), None),
        (AttitudeSetpoint(0.5, (0.0, 0.0, 1.005, 0.0)), None),
        (AttitudeSetpoint(0.5, (0.985, 0.0, 0.0, 0.0)), "quaternion"),
        (AttitudeSetpoint(0.5, (0.0, 1.015, 0.0, 0.0)), "quaternion"),
        (AttitudeSetpoint(0.5, (math.nan, 0.0, 0.0, 0.0)), "quaternion"),
        (AttitudeSetpoint(0.5, None, (0.0, -6.0, 7.9)), None),
        (AttitudeSetpoint(0.5, None, (0.0, -6.0, 8.1)), "rates"),
    ],
)
def test_an_attitude_is_refused_out_of_range(setpoint: AttitudeSetpoint, words: str | None) -> None:
    reported = attitude_refusal(setpoint)
    assert reported is None if words is None else words in (reported or "")


@pytest.mark.parametrize(
    ("q_arm", "words"),
    [
        ((LIMIT1, 0.0), None),
        ((-LIMIT1, 0.0), None),
        ((LIMIT1, LIMIT12 - LIMIT1), None),
        ((0.0, -LIMIT12), None),
        ((0.0, LIMIT12 + 1e-6), None),  # as much as a setpoint may be rounded
        ((LIMIT1 + 1e-6, 0.0), None),
        ((0.0, LIMIT12 + 2e-6), "together"),
        ((LIMIT1 + 0.01, -0.5), "joint 1 at 61 deg"),
        ((-LIMIT1 - 0.01, 0.5), "joint 1 at -61 deg"),
        ((0.5, LIMIT12 - 0.49), "joints 1 and 2 together at 91 deg"),
        ((-0.5, -LIMIT12 + 0.49), "joints 1 and 2 together at -91 deg"),
        ((math.nan, 0.0), "joint 1"),
        ((0.0, math.nan), "together"),
    ],
)
def test_the_arm_is_refused_what_it_cannot_do(q_arm: Vec2, words: str | None) -> None:
    reported = joints_refusal(q_arm, AIRFRAME)
    assert reported is None if words is None else words in (reported or "")
