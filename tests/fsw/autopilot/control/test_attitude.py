"""Attitude references and the loop that follows them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.pid import PidGains, attitude_pid, attitude_reference
from fsw.autopilot.geometry.rotation import (
    euler_zyx,
    matrix_from_quaternion,
    quaternion_from_matrix,
)
from fsw.autopilot.signals import Vec3
from tests.fsw.random_states import estimate_of, mat3

GAINS = PidGains(50.0, 8.0, 15.0, 25.0)
REST: Vec3 = (0.0, 0.0, 0.0)
horizontal = st.floats(-15.0, 15.0)
angles = st.floats(-math.pi, math.pi)


@given(horizontal, horizontal, st.floats(-15.0, 9.0), angles)
def test_thrust_along_the_reference_attitude_gives_the_acceleration(
    ax: float, ay: float, az: float, yaw: float
) -> None:
    roll, pitch, kept_yaw = attitude_reference((ax, ay, az), yaw)
    assert kept_yaw == yaw
    body_down = Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply([0.0, 0.0, 1.0])
    needed = np.array([0.0, 0.0, 9.81]) - np.array([ax, ay, az])
    np.testing.assert_allclose(body_down, needed / np.linalg.norm(needed), atol=1e-12)


def test_forward_is_nose_down_and_rightward_is_right_side_down() -> None:
    roll, pitch, _ = attitude_reference((1.0, 0.0, 0.0), 0.0)
    assert (pitch < -0.05, roll) == (True, 0.0)
    roll, pitch, _ = attitude_reference((0.0, 1.0, 0.0), 0.0)
    assert (roll > 0.05, abs(pitch) < 1e-12) == (True, True)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_loop_turns_towards_its_reference(axis: int, sign: float) -> None:
    reference = [0.0, 0.0, 0.0]
    reference[axis] = sign * 0.2
    level = estimate_of(Rotation.identity())
    wanted, _ = attitude_pid(GAINS, REST, level, (reference[0], reference[1], reference[2]), 0.002)
    assert sign * wanted[axis] > 1.0
    assert [wanted[k] for k in range(3) if k != axis] == [0.0, 0.0]


@pytest.mark.parametrize("axis", range(3))
def test_the_loop_brakes_a_turning_body(axis: int) -> None:
    w = [0.0, 0.0, 0.0]
    w[axis] = 1.0
    turning = estimate_of(Rotation.identity(), (w[0], w[1], w[2]))
    wanted, _ = attitude_pid(GAINS, REST, turning, REST, 0.002)
    assert wanted[axis] == pytest.approx(-GAINS.kd)


@pytest.mark.parametrize(
    ("yaw", "reference", "sign"), [(3.0, -3.0, 1.0), (-3.0, 3.0, -1.0), (math.pi, -math.pi, 0.0)]
)
def test_yaw_takes_the_short_way_across_south(yaw: float, reference: float, sign: float) -> None:
    there = estimate_of(Rotation.from_euler("Z", yaw))
    wanted, _ = attitude_pid(GAINS, REST, there, (0.0, 0.0, reference), 0.002)
    assert wanted[2] == pytest.approx(sign * 50.0 * (2.0 * math.pi - 6.0), rel=0.01, abs=1e-6)


def test_a_held_error_is_integrated_until_it_is_gone() -> None:
    integral, level = REST, estimate_of(Rotation.identity())
    first, integral = attitude_pid(GAINS, integral, level, (0.1, 0.0, 0.0), 0.002)
    for _ in range(100):
        later, integral = attitude_pid(GAINS, integral, level, (0.1, 0.0, 0.0), 0.002)
    assert later[0] > first[0]


quaternions = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(
    lambda q: 0.1 < sum(x * x for x in q) < 4.0
)


@given(quaternions)
def test_rotations_agree_with_scipy(q: tuple[float, float, float, float]) -> None:
    length = math.sqrt(sum(x * x for x in q))
    w, x, y, z = (component / length for component in q)
    reference = Rotation.from_quat([x, y, z, w])
    R = matrix_from_quaternion((w, x, y, z))
    np.testing.assert_allclose(R, mat3(reference), atol=1e-12)
    back = quaternion_from_matrix(R)
    assert back[0] >= 0.0
    again = Rotation.from_quat([back[1], back[2], back[3], back[0]])
    assert (again * reference.inv()).magnitude() < 1e-7
    if abs(R[6]) < 0.999:
        roll, pitch, yaw = euler_zyx(R)
        rebuilt = Rotation.from_euler("ZYX", [yaw, pitch, roll])
        assert (rebuilt * reference.inv()).magnitude() < 1e-7


def test_each_axis_has_its_own_error_and_its_own_integral() -> None:
    """At rest and within the limit the output is kp times error plus ki times integral."""
    integral: Vec3 = (0.1, -0.2, 0.3)
    roll, pitch, yaw = 0.11, -0.07, 0.4
    at = estimate_of(Rotation.from_euler("ZYX", [yaw, pitch, roll]))
    for errors in ((0.0, 0.0, 0.0), (0.02, 0.0, 0.0), (0.0, 0.03, 0.0), (0.0, 0.0, -0.05)):
        reference = (roll + errors[0], pitch + errors[1], yaw + errors[2])
        got, kept = attitude_pid(GAINS, integral, at, reference, 0.002)
        grown = np.array(integral) + 0.002 * np.array(errors)
        np.testing.assert_allclose(kept, grown, atol=1e-12)
        np.testing.assert_allclose(got, 50.0 * np.array(errors) + 8.0 * grown, atol=1e-9)
