"""The simulated inertial unit against its model: Allan deviation, turn-on values, digits, shake."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from sitl.sensors.exact import V4
from sitl.sensors.imu import ImuSensor
from sitl.sensors.keys import Imu
from tests.sitl.sensors.readings import HOVER, reading

RATE_HZ = 500.0
SPINS = (1.0, -1.0, 1.0, -1.0)
Array = npt.NDArray[np.float64]


def samples(count: int, seed: int = 0, thrust: V4 = HOVER, **keys: Any) -> Array:
    """(count, 6) of gyro [rad/s] and accelerometer [m/s²] at rest, less the truth."""
    sensor = ImuSensor(Imu(rate_hz=RATE_HZ, **keys), np.random.default_rng(seed), 8.0, SPINS)
    exact = reading()
    rows = []
    for _ in range(count):
        said = sensor.measure(exact, thrust, 0, False)
        rows.append((*said.gyro_B, *said.accel_B))
    return np.array(rows) - np.array([*exact.gyro_B, *exact.accel_B])


def allan_deviation(values: Array, samples_each: int) -> float:
    """Overlapping Allan deviation of one axis, over averages of so many samples.

    Source: IEEE Std 952-1997, annex C, with overlapping averages.
    """
    sums = np.concatenate([[0.0], np.cumsum(values)])
    averages = (sums[samples_each:] - sums[:-samples_each]) / samples_each
    steps = averages[samples_each:] - averages[:-samples_each]
    return math.sqrt(0.5 * float(np.mean(steps * steps)))


def modelled(tau: float, density: float, deviation: float, time_s: float) -> float:
    """Allan deviation of white noise and of exponentially correlated noise.

    Source: IEEE Std 952-1997, annex C.1.1 (angle random walk) and C.1.7 (Markov noise), where the
    driving noise q of the latter is deviation · √(2 / time_s).
    """
    q2 = 2.0 * deviation * deviation / time_s
    ratio = time_s / tau
    bracket = 3.0 - 4.0 * math.exp(-1.0 / ratio) + math.exp(-2.0 / ratio)
    markov = q2 * time_s * time_s / tau * (1.0 - 0.5 * ratio * bracket)
    return math.sqrt(density * density / tau + markov)


@pytest.mark.drawn(1)
@pytest.mark.parametrize("first", [0, 3], ids=["gyro", "accelerometer"])
def test_the_allan_deviation_is_that_of_the_model(first: int) -> None:
    density, deviation, time_s = (1e-3, 4e-3, 2.0) if first == 0 else (8e-3, 2e-2, 2.0)
    names = ("gyro", "rad_s") if first == 0 else ("accel", "m_s2")
    keys = {
        f"{names[0]}_density_{names[1]}": density,
        f"{names[0]}_bias_{names[1]}": deviation,
        f"{names[0]}_bias_time_s": time_s,
    }
    values = samples(150_000, **keys)
    for tau in (0.01, 0.1, 0.3, 1.0, 3.0, 10.0):
        each = round(tau * RATE_HZ)
        measured = np.sqrt(
            np.mean([allan_deviation(values[:, first + k], each) ** 2 for k in range(3)])
        )
        # Three axes of 300 s: at 10 s some 90 independent averages, 8 % of deviation.
        assert measured == pytest.approx(
            modelled(tau, density, deviation, time_s), rel=0.03 if tau < 1.0 else 0.2
        ), tau
    # The bottom of the curve is where a data sheet reads the bias instability.
    assert modelled(1.89 * time_s, 0.0, deviation, time_s) == pytest.approx(
        0.617 * deviation, rel=0.002
    )


def test_what_is_drawn_at_turn_on_stays_and_has_the_stated_deviation() -> None:
    keys = {"gyro_turn_on_rad_s": 0.003, "accel_turn_on_m_s2": 0.06}
    units = np.array([samples(2, seed, **keys) for seed in range(400)])
    assert np.array_equal(units[:, 0], units[:, 1])
    assert units[:, 0, :3].std() == pytest.approx(0.003, rel=0.07)
    assert units[:, 0, 3:].std() == pytest.approx(0.06, rel=0.07)


def test_scale_and_misalignment_have_the_stated_deviations() -> None:
    scaled = np.array([samples(1, seed, accel_scale_share=0.01)[0] for seed in range(400)])
    assert (scaled[:, 5] / 9.7).std() == pytest.approx(0.01, rel=0.1)
    assert not scaled[:, :3].any()  # of the other instrument
    turned = np.array([samples(1, seed, misalignment_deg=1.0)[0] for seed in range(400)])
    # Gravity along −z leaks into x by the angle between the axes.
    assert (turned[:, 3] / 9.7).std() == pytest.approx(math.radians(1.0), rel=0.1)


def test_a_reading_lies_on_the_grid_of_its_digits_and_within_the_range() -> None:
    keys = {"accel_density_m_s2": 0.1, "accel_resolution_m_s2": 0.5, "accel_limit_m_s2": 9.5}
    exact = np.array(reading().accel_B)
    accel = samples(2000, **keys)[:, 3:] + exact
    assert np.allclose(accel / 0.5, np.rint(accel / 0.5), atol=1e-9)
    assert np.abs(accel).max() <= 9.5
    assert (accel[:, 2] == -9.5).any()


@pytest.mark.parametrize("limit", [9.5, 34.9, 156.9, 100.0])
@pytest.mark.parametrize("resolution", [0.0, 1.065e-3, 4.788e-3, 0.3, 7.0])
def test_no_saturated_reading_exceeds_the_range(limit: float, resolution: float) -> None:
    keys = Imu(
        rate_hz=RATE_HZ,
        gyro_limit_rad_s=limit,
        accel_limit_m_s2=limit,
        gyro_resolution_rad_s=resolution,
        accel_resolution_m_s2=resolution,
    )
    sensor = ImuSensor(keys, np.random.default_rng(0), 8.0, SPINS)
    said = sensor.measure(reading(), HOVER, 0, True)
    assert said.gyro_B == (limit, -limit, limit)
    assert said.accel_B == (limit, -limit, limit)


def test_the_rotors_shake_at_their_frequency_and_harder_with_thrust() -> None:
    keys = {"vibration_m_s2": 1.0, "vibration_rad_s": 0.02, "rotor_hz": 75.0}
    hover, one = samples(5000, **keys), samples(5000, thrust=(8.0, 0.0, 0.0, 0.0), **keys)
    spectrum = np.abs(np.fft.rfft(one[:, 3]))
    assert np.fft.rfftfreq(5000, 1.0 / RATE_HZ)[spectrum.argmax()] == pytest.approx(75.0, abs=0.2)
    assert one[:, 3].std() == pytest.approx(math.sqrt(0.5), rel=0.02)
    assert one[:, 1].std() == pytest.approx(0.02 * math.sqrt(0.5), rel=0.02)
    fast = samples(5000, thrust=(16.0, 0.0, 0.0, 0.0), **keys)
    assert fast[:, 3].std() == pytest.approx(2.0 * math.sqrt(0.5), rel=0.02)
    spectrum = np.abs(np.fft.rfft(fast[:, 3]))
    faster = np.fft.rfftfreq(5000, 1.0 / RATE_HZ)[spectrum.argmax()]
    assert faster == pytest.approx(75.0 * math.sqrt(2.0), abs=0.2)
    assert not samples(10, thrust=(0.0, 0.0, 0.0, 0.0), **keys).any()
    assert hover.std() > 0.0


def test_an_outlier_is_a_spike_to_the_ends_of_the_range() -> None:
    keys = Imu(rate_hz=RATE_HZ, gyro_limit_rad_s=34.9, accel_limit_m_s2=156.9)
    sensor = ImuSensor(keys, np.random.default_rng(0), 8.0, SPINS)
    said = sensor.measure(reading(), HOVER, 0, True)
    assert said.gyro_B == (34.9, -34.9, 34.9)
    assert said.accel_B == (156.9, -156.9, 156.9)
