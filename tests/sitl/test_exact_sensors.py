"""Sensors: the truth by default, an exact delay, noise of the stated size."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sitl.scenario import EncoderErrors, ImuErrors, PoseErrors, Sensors
from sitl.sensors.exact import ExactSensors, SensorReadings, turned


def _exact(k: int) -> SensorReadings:
    """A reading in which every number says when it was taken."""
    x = float(k)
    three, two = (x, x, x), (x, x)
    return SensorReadings(
        t_us=1_000_000 + 2000 * k,
        p_WB=three,
        v_WB=three,
        q_WB=(math.cos(0.01 * x), 0.0, 0.0, math.sin(0.01 * x)),
        w_WB_B=three,
        gyro_B=three,
        accel_B=three,
        q_arm=two,
        qd_arm=two,
        tau_arm=two,
    )


def test_sensors_are_exact_by_default() -> None:
    suite = ExactSensors(Sensors(), 0, 2000)
    assert all(suite.measure(_exact(k)) == _exact(k) for k in range(10))


@pytest.mark.parametrize("latency_ms", [0.0, 2.0, 10.0, 200.0])
def test_latency_hands_back_the_sample_of_exactly_that_age(latency_ms: float) -> None:
    sensors = Sensors(pose=PoseErrors(latency_ms=latency_ms))
    suite = ExactSensors(sensors, 0, 2000)
    age = round(latency_ms / 2.0)
    for k in range(150):
        reading = suite.measure(_exact(k))
        assert reading.t_us == _exact(k).t_us
        assert reading.p_WB == _exact(max(k - age, 0)).p_WB
        assert reading.q_WB == _exact(max(k - age, 0)).q_WB
        assert reading.gyro_B == _exact(k).gyro_B  # the other sensors are not delayed
        assert reading.q_arm == _exact(k).q_arm


NOISY = Sensors(
    imu=ImuErrors(gyro_rad_s=0.02, accel_m_s2=0.3),
    pose=PoseErrors(position_m=0.001, velocity_m_s=0.01, attitude_rad=0.005, rate_rad_s=0.03),
    encoders=EncoderErrors(angle_rad=0.002, rate_rad_s=0.04, torque_n_m=0.05),
)


def _noise(sensors: Sensors, seed: int, samples: int) -> dict[str, np.ndarray]:
    """Measured minus true for each field of many readings of the same truth."""
    suite, exact = ExactSensors(sensors, seed, 2000), _exact(0)
    readings = [suite.measure(exact) for _ in range(samples)]
    names = [name for name in SensorReadings._fields if name != "t_us"]
    return {
        name: np.array([getattr(r, name) for r in readings]) - getattr(exact, name)
        for name in names
    }


def test_noise_has_the_stated_deviation_no_bias_and_no_memory() -> None:
    noise = _noise(NOISY, 1, 20_000)
    sigmas = {
        "p_WB": 0.001, "v_WB": 0.01, "w_WB_B": 0.03, "gyro_B": 0.02, "accel_B": 0.3,
        "q_arm": 0.002, "qd_arm": 0.04, "tau_arm": 0.05,
    }  # fmt: skip
    for name, sigma in sigmas.items():
        assert np.abs(noise[name].std(axis=0) / sigma - 1.0).max() < 0.03, name
        assert np.abs(noise[name].mean(axis=0)).max() < 0.05 * sigma, name
        assert abs(np.corrcoef(noise[name][1:, 0], noise[name][:-1, 0])[0, 1]) < 0.05, name
    # A small turn δ changes the quaternion's vector part by δ/2.
    assert np.abs(noise["q_WB"][:, 1:].std(axis=0) / 0.0025 - 1.0).max() < 0.03


def test_switching_one_noise_on_leaves_the_others_draws_alone() -> None:
    only_gyro = Sensors(imu=ImuErrors(gyro_rad_s=0.02))
    assert np.array_equal(_noise(only_gyro, 1, 50)["gyro_B"], _noise(NOISY, 1, 50)["gyro_B"])


def test_attitude_noise_keeps_the_quaternion_at_unit_length() -> None:
    q = turned((0.6, 0.0, 0.8, 0.0), (0.3, -0.2, 0.1))
    assert math.hypot(*q) == pytest.approx(1.0, abs=1e-15)
