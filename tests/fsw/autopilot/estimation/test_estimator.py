"""What becomes an estimate and what does not."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.estimation.estimator import INERTIAL, JOINTS, POSE, estimate_state, read_frame
from fsw.autopilot.signals import SensorFrame, Vec4
from fsw.autopilot.tick_record import new_tick
from tests.fsw.random_states import mat3

GOOD = SensorFrame(
    t_us=1_000_000,
    p_WB=(1.0, 2.0, -3.0),
    v_WB=(0.1, 0.2, 0.3),
    q_WB=(1.0, 0.0, 0.0, 0.0),
    gyro_B=(0.01, 0.02, 0.03),
    accel_B=(0.0, 0.0, -9.81),
    q_arm=(0.1, 0.2),
    qd_arm=(0.3, 0.4),
)
USED = ["p_WB", "v_WB", "q_WB", "gyro_B", "q_arm", "qd_arm"]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", USED)
def test_one_reading_that_is_no_number_invalidates_the_frame(name: str, value: float) -> None:
    readings = getattr(GOOD, name)
    for index in range(len(readings)):
        broken: Any = (*readings[:index], value, *readings[index + 1 :])
        assert estimate_state(replace(GOOD, **{name: broken})) is None


@pytest.mark.parametrize(
    ("name", "largest"),
    [
        ("p_WB", 1e5),
        ("v_WB", 100.0),
        ("gyro_B", 100.0),
        ("q_arm", 100.0),
        ("qd_arm", 100.0),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_no_vehicle_of_this_kind_does_is_no_state(
    name: str, largest: float, sign: float
) -> None:
    readings = getattr(GOOD, name)
    for index in range(len(readings)):
        for value, usable in ((0.999 * largest, True), (largest, False), (1e300, False)):
            changed: Any = (*readings[:index], sign * value, *readings[index + 1 :])
            assert (estimate_state(replace(GOOD, **{name: changed})) is not None) is usable


@pytest.mark.parametrize(("force", "usable"), [(999.0, True), (-999.0, True), (-1000.0, False)])
def test_a_specific_force_out_of_range_is_no_state(force: float, usable: bool) -> None:
    assert (estimate_state(replace(GOOD, accel_B=(0.0, 0.0, force))) is not None) is usable


PARTS = {"p_WB": POSE, "v_WB": POSE, "q_WB": POSE, "gyro_B": INERTIAL, "q_arm": JOINTS}


@pytest.mark.parametrize("name", PARTS)
def test_a_part_that_is_no_number_is_named_and_the_others_stay(name: str) -> None:
    nothing: Any = (math.nan,) * len(getattr(GOOD, name))
    r = new_tick(3.5, 4, 2)
    assert read_frame(replace(GOOD, **{name: nothing}), r) == PARTS[name]
    state = r.state_estimate
    assert state is not None
    if name != "gyro_B":
        assert state.w_WB_B == GOOD.gyro_B


def test_opposite_infinities_do_not_cancel() -> None:
    assert estimate_state(replace(GOOD, p_WB=(math.inf, -math.inf, 0.0))) is None


@pytest.mark.parametrize("q", [(0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0)])
def test_a_quaternion_far_from_unit_is_no_attitude(q: Vec4) -> None:
    assert estimate_state(replace(GOOD, q_WB=q)) is None


def test_rounding_of_the_quaternion_does_not_scale_the_rotation() -> None:
    estimate = estimate_state(replace(GOOD, q_WB=(1.01, 0.02, -0.01, 0.3)))
    assert estimate is not None
    R = np.reshape(estimate.R_WB, (3, 3))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)


def test_a_reading_nobody_uses_cannot_ground_the_vehicle() -> None:
    assert estimate_state(replace(GOOD, accel_B=(math.nan, 0.0, 0.0))) is not None


def test_readings_pass_unchanged_and_attitude_agrees_with_scipy() -> None:
    rotation = Rotation.from_euler("ZYX", [2.5, -0.4, 0.3])
    x, y, z, w = (float(c) for c in rotation.as_quat())
    estimate = estimate_state(replace(GOOD, q_WB=(w, x, y, z)))
    assert estimate is not None
    assert (estimate.t_us, estimate.p_WB, estimate.v_WB) == (1_000_000, GOOD.p_WB, GOOD.v_WB)
    assert (estimate.w_WB_B, estimate.q_arm, estimate.qd_arm) == (
        GOOD.gyro_B,
        GOOD.q_arm,
        GOOD.qd_arm,
    )
    np.testing.assert_allclose(estimate.R_WB, mat3(rotation), atol=1e-12)
    assert estimate.yaw == pytest.approx(2.5)


def test_both_signs_of_a_quaternion_are_one_attitude() -> None:
    q: Vec4 = (0.8, 0.0, 0.6, 0.0)
    other: Vec4 = (-0.8, 0.0, -0.6, 0.0)
    one, two = estimate_state(replace(GOOD, q_WB=q)), estimate_state(replace(GOOD, q_WB=other))
    assert one is not None
    assert two is not None
    np.testing.assert_allclose(one.R_WB, two.R_WB)


def test_the_specific_force_is_the_push_against_the_bodys_third_axis() -> None:
    estimate = estimate_state(replace(GOOD, accel_B=(1.0, 2.0, -11.5)))
    assert estimate is not None
    assert estimate.specific_force == 11.5


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_the_one_accelerometer_axis_that_is_used_must_be_a_number(value: float) -> None:
    assert estimate_state(replace(GOOD, accel_B=(0.0, 0.0, value))) is None


@pytest.mark.parametrize(
    ("norm2", "usable"), [(0.5, False), (0.51, True), (1.0, True), (1.99, True), (2.0, False)]
)
def test_the_square_of_the_quaternions_length_lies_between_a_half_and_two(
    norm2: float, usable: bool
) -> None:
    # Two equal components: a half and two come out exactly.
    part = 0.5 if norm2 == 0.5 else 1.0 if norm2 == 2.0 else math.sqrt(0.5 * norm2)
    assert (estimate_state(replace(GOOD, q_WB=(part, part, 0.0, 0.0))) is not None) is usable
