"""Every other sensor: errors of the stated sizes around the truth."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from sitl.sensors.barometer import SEA_LEVEL_PA, BarometerSensor, standard_pressure
from sitl.sensors.encoders import EncoderSensor
from sitl.sensors.gnss import GnssSensor
from sitl.sensors.keys import (
    Barometer,
    Encoders,
    Gnss,
    Magnetometer,
    MotionCapture,
    Rangefinder,
    VisualOdometry,
)
from sitl.sensors.magnetometer import MagnetometerSensor
from sitl.sensors.motion_capture import MotionCaptureSensor, PoseMeasurement
from sitl.sensors.rangefinder import RangefinderSensor
from sitl.sensors.visual_odometry import VisualOdometrySensor
from tests.sitl.sensors.readings import HOVER, reading

EXACT = reading()
COUNT = 4000


def random() -> np.random.Generator:
    """A stream of its own for each test."""
    return np.random.default_rng(7)


def angle_between(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Angle [rad] of the rotation from one attitude to the other."""
    return 2.0 * math.acos(min(abs(sum(x * y for x, y in zip(a, b, strict=True))), 1.0))


def test_motion_capture_is_off_by_the_stated_deviations_and_states_them() -> None:
    keys = MotionCapture(rate_hz=120.0, position_m=0.0005, attitude_deg=0.2)
    sensor = MotionCaptureSensor(keys, random())
    said = [sensor.measure(EXACT, HOVER, 5, False) for _ in range(COUNT)]
    p = np.array([one.p_WB for one in said]) - EXACT.p_WB
    assert p.std(axis=0) == pytest.approx([0.0005] * 3, rel=0.05)
    turn = np.array([angle_between(one.q_WB, EXACT.q_WB) for one in said])
    assert math.sqrt(float(np.mean(turn * turn)) / 3.0) == pytest.approx(
        math.radians(0.2), rel=0.05
    )
    assert said[0].position_variance == pytest.approx((0.0005**2,) * 3)
    assert said[0].attitude_variance == pytest.approx((math.radians(0.2) ** 2,) * 3)
    assert said[0].t_us == 5


def test_an_outlier_of_a_pose_is_off_by_the_stated_length_and_angle() -> None:
    keys = MotionCapture(rate_hz=120.0, outlier_m=0.3, outlier_deg=30.0)
    sensor = MotionCaptureSensor(keys, random())
    said = [sensor.measure(EXACT, HOVER, 0, True) for _ in range(100)]
    off = np.array([one.p_WB for one in said]) - EXACT.p_WB
    assert np.linalg.norm(off, axis=1) == pytest.approx([0.3] * 100)
    assert np.linalg.norm(off.mean(axis=0)) < 0.1  # in any direction
    assert all(
        angle_between(one.q_WB, EXACT.q_WB) == pytest.approx(math.radians(30.0)) for one in said
    )


def test_a_pose_lies_on_the_grid_of_its_digits_and_nearest_to_what_is_seen() -> None:
    noise = {"rate_hz": 120.0, "position_m": 0.01, "attitude_deg": 1.0}
    steps = {"position_resolution_m": 0.002, "attitude_resolution_deg": 0.5}
    fine = MotionCaptureSensor(MotionCapture(**noise), random())
    coarse = MotionCaptureSensor(MotionCapture(**noise, **steps), random())
    turns = set()
    for _ in range(300):
        exact, said = (one.measure(EXACT, HOVER, 0, False) for one in (fine, coarse))
        place = np.array(said.p_WB) / 0.002
        assert np.abs(place - np.rint(place)).max() < 1e-9
        assert np.abs(np.subtract(said.p_WB, exact.p_WB)).max() <= 0.001 + 1e-12
        assert math.dist(said.q_WB, (0.0,) * 4) == pytest.approx(1.0, abs=1e-12)
        assert angle_between(said.q_WB, exact.q_WB) < math.radians(0.5)
        turns.add(said.q_WB)
    assert len(turns) < 300


def test_odometry_has_its_digits_after_its_drift() -> None:
    keys = VisualOdometry(rate_hz=30.0, drift_m=0.1, drift_deg=1.0, position_resolution_m=0.005)
    sensor = VisualOdometrySensor(keys, random())
    for _ in range(50):
        place = np.array(sensor.measure(EXACT, HOVER, 0, False).p_WB) / 0.005
        assert np.abs(place - np.rint(place)).max() < 1e-9


def drifted(seed: int, seconds: float, **keys: float) -> list[PoseMeasurement]:
    """What visual odometry says of one place."""
    more = VisualOdometry(rate_hz=30.0, **keys)
    sensor = VisualOdometrySensor(more, np.random.default_rng(seed))
    return [sensor.measure(EXACT, HOVER, 0, False) for _ in range(round(30 * seconds))]


@pytest.mark.long
def test_visual_odometry_walks_off_with_the_root_of_time_and_leaves_gravity_alone() -> None:
    ends = [drifted(seed, 20.0, drift_m=0.01, drift_deg=0.1)[-1] for seed in range(150)]
    z = np.array([one.p_WB[2] for one in ends]) - EXACT.p_WB[2]
    assert z.std() == pytest.approx(0.01 * math.sqrt(20.0), rel=0.2)
    turns = np.array([angle_between(one.q_WB, EXACT.q_WB) for one in ends])
    assert math.sqrt(float(np.mean(turns**2))) == pytest.approx(
        math.radians(0.1) * math.sqrt(20.0), rel=0.2
    )
    down = matrix_from_quaternion(EXACT.q_WB)[6:]
    for one in ends:
        assert matrix_from_quaternion(one.q_WB)[6:] == pytest.approx(down, abs=1e-12)


def test_a_turned_frame_turns_place_and_attitude_about_its_own_origin() -> None:
    said = drifted(3, 60.0, drift_deg=1.0)[-1]
    x, y, z = said.p_WB
    ex, ey, ez = EXACT.p_WB
    assert math.hypot(x, y) == pytest.approx(math.hypot(ex, ey))
    assert z == ez


def test_visual_odometry_jumps_back_to_near_the_truth_and_says_so() -> None:
    said = drifted(1, 300.0, drift_m=0.05, recognises_every_s=20.0, recognised_m=0.002)
    counts = np.array([one.resets for one in said])
    assert 8 <= counts[-1] <= 25  # 15 are expected
    off = np.linalg.norm(np.array([one.p_WB for one in said]) - EXACT.p_WB, axis=1)
    after = np.flatnonzero(np.diff(counts)) + 1
    assert off[after].max() < 0.01
    assert off[after - 1].max() > 0.1
    assert said[0].from_cameras_on_board


@pytest.mark.long
def test_visual_odometry_states_how_far_it_may_have_drifted() -> None:
    keys = {"drift_m": 0.01, "drift_deg": 0.3, "recognises_every_s": 8.0, "recognised_m": 0.002}
    ends = [drifted(seed, 10.0, position_m=0.001, **keys)[-1] for seed in range(300)]
    off = np.array([one.p_WB for one in ends]) - EXACT.p_WB
    stated = np.array([one.position_variance for one in ends])
    # Each axis, the far one of a turned frame included: normalised squares are 1 on average.
    assert (off**2 / stated).mean(axis=0) == pytest.approx([1.0] * 3, abs=0.25)
    begin, later = drifted(1, 5.0, drift_deg=0.3)[0], drifted(1, 5.0, drift_deg=0.3)[-1]
    assert later.attitude_variance[:2] == begin.attitude_variance[:2] == (0.0, 0.0)
    assert later.attitude_variance[2] == pytest.approx(149.0 / 30.0 * math.radians(0.3) ** 2)


def test_satellites_wander_slowly_and_scatter_at_once() -> None:
    keys = Gnss(
        rate_hz=10.0, horizontal_m=0.2, vertical_m=0.3, wander_horizontal_m=1.0,
        wander_vertical_m=2.0, wander_time_s=5.0, velocity_m_s=0.05,
    )  # fmt: skip
    sensor = GnssSensor(keys, random())
    said = [sensor.measure(EXACT, HOVER, 0, False) for _ in range(20_000)]
    p = np.array([one.p_WB for one in said]) - EXACT.p_WB
    assert p.std(axis=0) == pytest.approx(
        [math.hypot(0.2, 1.0)] * 2 + [math.hypot(0.3, 2.0)], rel=0.1
    )
    steps = np.diff(p, axis=0)
    # Of white noise √2; of the wandering part nearly nothing.
    fresh = 2.0 * (1.0 - math.exp(-0.1 / 5.0))
    assert steps.std(axis=0)[0] == pytest.approx(math.sqrt(2.0 * 0.04 + fresh), rel=0.03)
    v = np.array([one.v_WB for one in said]) - EXACT.v_WB
    assert v.std(axis=0) == pytest.approx([0.05] * 3, rel=0.05)
    assert said[0].horizontal_deviation == pytest.approx(math.hypot(0.2, 1.0))


def test_satellites_have_the_digits_of_their_message_unless_told_otherwise() -> None:
    noise = {"rate_hz": 10.0, "horizontal_m": 0.2, "vertical_m": 0.3, "velocity_m_s": 0.05}
    plain = GnssSensor(Gnss(**noise), random(), 60.0).measure(EXACT, HOVER, 0, False)
    none = Gnss(
        **noise,
        position_resolution_deg=0.0,
        height_resolution_m=0.0,
        velocity_resolution_m_s=0.0,
    )
    exact = GnssSensor(none, random(), 60.0).measure(EXACT, HOVER, 0, False)
    # 1e-7 deg northwards; eastwards half of it at 60 deg north; mm; cm/s.
    north = 6_371_000.0 * math.radians(1e-7)
    steps = np.array([north, 0.5 * north, 1e-3, 1e-2, 1e-2, 1e-2])
    said = np.array([*plain.p_WB, *plain.v_WB])
    assert np.abs(said / steps - np.rint(said / steps)).max() < 1e-6
    off = np.abs(said - [*exact.p_WB, *exact.v_WB])
    assert (off > 0.0).all()
    assert (off <= 0.5 * steps + 1e-12).all()


def test_the_standard_atmosphere() -> None:
    # ISO 2533, table 5.
    assert standard_pressure(0.0) == SEA_LEVEL_PA
    assert standard_pressure(1000.0) == pytest.approx(89_874.6, abs=0.5)
    assert standard_pressure(3000.0) == pytest.approx(70_108.5, abs=1.0)


def test_a_barometer_has_noise_steps_and_a_day_of_its_own() -> None:
    keys = Barometer(rate_hz=50.0, noise_pa=1.2, resolution_pa=0.5)
    sensor = BarometerSensor(keys, random())
    said = np.array([sensor.measure(EXACT, HOVER, 0, False).pressure_pa for _ in range(COUNT)])
    assert np.allclose(said / 0.5, np.rint(said / 0.5))
    assert said.mean() == pytest.approx(standard_pressure(1.2), abs=0.1)
    assert said.std() == pytest.approx(math.hypot(1.2, 0.5 / math.sqrt(12.0)), rel=0.05)
    days = [
        BarometerSensor(Barometer(rate_hz=50.0, offset_pa=200.0), np.random.default_rng(k))
        for k in range(300)
    ]
    first = np.array([one.measure(EXACT, HOVER, 0, False).pressure_pa for one in days])
    assert (first - standard_pressure(1.2)).std() == pytest.approx(200.0, rel=0.1)


def test_a_magnetometer_sees_the_field_in_the_bodys_axes() -> None:
    field = (0.2, 0.01, 0.43)
    sensor = MagnetometerSensor(Magnetometer(rate_hz=50.0, field_gauss=field), random())
    said = sensor.measure(EXACT, HOVER, 0, False).field_B
    R = np.array(matrix_from_quaternion(EXACT.q_WB)).reshape(3, 3)
    assert R @ np.array(said) == pytest.approx(field)
    noisy = MagnetometerSensor(
        Magnetometer(rate_hz=50.0, field_gauss=field, noise_gauss=0.003, offset_gauss=0.01),
        random(),
    )
    rows = np.array([noisy.measure(EXACT, HOVER, 0, False).field_B for _ in range(COUNT)])
    assert rows.std(axis=0) == pytest.approx([0.003] * 3, rel=0.05)
    assert np.abs(rows.mean(axis=0) - said).max() > 0.001


def test_a_rangefinder_measures_along_the_tilted_axis_and_is_silent_out_of_range() -> None:
    keys = Rangefinder(rate_hz=50.0, least_m=0.1, most_m=10.0)
    sensor = RangefinderSensor(keys, random())
    said = sensor.measure(EXACT, HOVER, 0, False)
    assert said is not None
    assert said.distance == pytest.approx(1.2 / math.cos(0.1))
    high = EXACT._replace(p_WB=(0.0, 0.0, -11.0))
    low = EXACT._replace(p_WB=(0.0, 0.0, -0.05))
    upside_down = EXACT._replace(q_WB=(0.0, 1.0, 0.0, 0.0))
    for lost in (high, low, upside_down):
        assert sensor.measure(lost, HOVER, 0, False) is None


def test_encoders_count_steps_and_know_no_rate() -> None:
    grid = 2.0 * math.pi / 4096.0
    sensor = EncoderSensor(Encoders(rate_hz=500.0, resolution_rad=grid), random(), 2)
    arm = [sensor.measure(EXACT._replace(q_arm=(k * 1e-4, -0.3)), HOVER, 0, False).angles
           for k in range(100)]  # fmt: skip
    first = np.array(arm)[:, 0]
    assert np.allclose(first / grid, np.rint(first / grid))
    assert np.abs(first - 1e-4 * np.arange(100)).max() <= 0.5 * grid + 1e-12
    offset = EncoderSensor(Encoders(rate_hz=500.0, offset_rad=0.01, noise_rad=0.001), random(), 2)
    rows = np.array([offset.measure(EXACT, HOVER, 0, False).angles for _ in range(COUNT)])
    assert rows.std(axis=0) == pytest.approx([0.001] * 2, rel=0.05)
    assert np.abs(rows.mean(axis=0) - EXACT.q_arm).max() > 1e-3
