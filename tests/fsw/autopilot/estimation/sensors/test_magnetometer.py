"""A magnetometer's offset that is considered, against a filter that has it as a state."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fsw.autopilot.estimation.error_state import ERRORS, FIELD, FILTER, TH, correct, distance
from fsw.autopilot.estimation.faults.sources import NOBODY, Source
from fsw.autopilot.estimation.fusion_memory import at_start
from fsw.autopilot.estimation.sensor_fusion import SensorFusion
from fsw.autopilot.estimation.sensors.gnss import velocity_rows
from fsw.autopilot.estimation.sensors.magnetometer import (
    MagnetometerTuning,
    correct_with_offset,
    distance_with_offset,
    heading_rows,
)
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.geometry.quaternion import turned
from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from fsw.autopilot.measurements import MagneticSample, Sample, Sensor
from fsw.compiled import packed
from tests.fsw.autopilot.estimation.sensor_runs import EARTH, RTK, START, run

Array = NDArray[np.float64]
LAW = packed(MagnetometerTuning(declination=0.1)).view(np.recarray)[0]
OFFSET = 0.02  # Gauss
STEP = 1e-6


def with_offset(offset: float) -> EstimatorTuning:
    return replace(RTK.tuning, magnetometer=replace(RTK.tuning.magnetometer, offset=offset))


def some_state(X: Array, P: Array) -> Any:
    """A filter that has heard a magnetometer, with covariance P (17, 17) and X (17, 3) [SI]."""
    x = np.zeros(1, dtype=FILTER).view(np.recarray)[0]
    x["q"] = turned((1.0, 0.0, 0.0, 0.0), 0.2, -0.1, 0.7)
    x["covariance"], x["with_offset"], x["compass"] = P, X, 1
    return x


def measured(x: Any) -> tuple[float, float, float]:
    R = np.array(matrix_from_quaternion(tuple(x["q"]))).reshape(3, 3)
    a, b, c = (R.T @ np.array([0.2 * math.cos(0.1), 0.2 * math.sin(0.1), 0.4])).tolist()
    return a, b, c


def some_covariance() -> Array:
    """Of the error and the offset (20, 20)."""
    A = np.random.default_rng(5).standard_normal((ERRORS + FIELD, ERRORS + FIELD))
    whole = A @ A.T / ERRORS
    # The offset is known as well as the filter takes it to be.
    root = np.linalg.cholesky(whole[ERRORS:, ERRORS:])
    whole[ERRORS:] = OFFSET * np.linalg.solve(root, whole[ERRORS:])
    whole[:, ERRORS:] = OFFSET * np.linalg.solve(root, whole[:, ERRORS:].T).T
    return whole


def test_the_heading_falls_with_the_offset_by_its_slope() -> None:
    x = some_state(np.zeros((ERRORS, FIELD)), np.eye(ERRORS))
    field = measured(x)
    assert heading_rows(x, LAW, field, 0.0)
    slope = x["offset_slope"].copy()
    for axis in range(FIELD):
        found = []
        for by in (STEP, -STEP):
            shifted = list(field)
            shifted[axis] += by
            heading_rows(x, LAW, tuple(shifted), 0.0)
            found.append(float(x["residual"][0]))
        assert (found[0] - found[1]) / (2 * STEP) == pytest.approx(slope[axis], abs=1e-6)


def test_a_considered_offset_is_one_that_a_larger_filter_does_not_correct() -> None:
    whole = some_covariance()
    P, X = whole[:ERRORS, :ERRORS], whole[:ERRORS, ERRORS:]
    np.testing.assert_allclose(whole[ERRORS:, ERRORS:], OFFSET**2 * np.eye(FIELD), atol=1e-12)
    x = some_state(X, P)
    heading_rows(x, LAW, measured(x), 0.0)
    H = np.concatenate([x["H"][0], x["offset_slope"]])
    r, R = 0.03, float(x["variance"][0])
    x["residual"][0] = r
    S = H @ whole @ H + R
    K = whole @ H / S
    K[ERRORS:] = 0.0
    I_KH = np.eye(ERRORS + FIELD) - np.outer(K, H)
    expected = I_KH @ whole @ I_KH.T + R * np.outer(K, K)  # Joseph's form, for any gain
    assert distance_with_offset(x, OFFSET) == pytest.approx(r * r / S)
    correct_with_offset(x, OFFSET)
    np.testing.assert_allclose(x["error"], K[:ERRORS] * r, atol=1e-12)
    np.testing.assert_allclose(x["covariance"], expected[:ERRORS, :ERRORS], atol=1e-12)
    np.testing.assert_allclose(x["with_offset"], expected[:ERRORS, ERRORS:], atol=1e-12)


def test_other_measurements_carry_the_offsets_share_of_the_error() -> None:
    whole = some_covariance()
    x = some_state(whole[:ERRORS, ERRORS:], whole[:ERRORS, :ERRORS])
    velocity_rows(x, (0.1, -0.1, 0.2), (0.01, 0.02, 0.03), 0.0)
    H, N = x["H"][:3].copy(), np.diag(x["variance"])
    P, X = whole[:ERRORS, :ERRORS], whole[:ERRORS, ERRORS:]
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + N)
    distance(x, 3)
    correct(x, 3)
    np.testing.assert_allclose(x["with_offset"], X - K @ H @ X, atol=1e-12)


def heading_sigma(suite_offset: float) -> float:
    """Deviation of the heading [rad] after 6 s with satellites and a magnetometer."""
    tuning = with_offset(suite_offset)
    fusion_, memory = SensorFusion(tuning, 2), at_start(2)
    flown, now = run(replace(RTK, tuning=tuning), 4, 6.0), 0.0
    for now, samples in flown:
        memory, _ = fusion_.step(memory, samples, now)
    return math.sqrt(fusion_.covariance(memory, now)[TH + 2, TH + 2])


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-2")
def test_no_number_of_readings_takes_an_offset_away() -> None:
    # Of 0.05 rad, what accelerations of some m/s^2 do not tell of the heading.
    assert heading_sigma(0.05 * EARTH[0]) > 2.0 * heading_sigma(0.0)


@pytest.mark.requirement("REQ-EST-2")
def test_a_heading_that_is_off_for_good_is_off_by_what_is_told() -> None:
    """Every reading is turned by 0.045 rad, as hard iron turns it where a vehicle stays level."""
    tuning = with_offset(0.011)
    shift = np.array([0.0, 0.0099, 0.0])
    chi = []
    for seed in range(6):
        fusion_, memory, now = SensorFusion(tuning, 2), at_start(2), 0.0
        flown = run(replace(RTK, tuning=with_offset(0.0)), 40 + seed, 3.0)
        estimate = None
        for now, samples in flown:
            memory, estimate = fusion_.step(memory, [_shifted(one, shift) for one in samples], now)
        assert estimate is not None
        truth = np.array(
            matrix_from_quaternion(tuple(flown.truth.q[flown.truth.at(now)].tolist()))
        ).reshape(3, 3)
        turn = np.array(estimate.R_WB).reshape(3, 3).T @ truth
        error = 0.5 * np.array(
            [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
        )
        P = fusion_.covariance(memory, now)[TH : TH + 3, TH : TH + 3]
        chi.append(float(error @ np.linalg.solve(P, error)))
    assert np.mean(chi) < 6.0  # of 3; 22 without the offset


def _shifted(sample: Sample, by: Array) -> Sample:
    if not isinstance(sample, MagneticSample):
        return sample
    a, b, c = (np.array(sample.field) + by).tolist()
    return replace(sample, field=(a, b, c))


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-EST-4")
@pytest.mark.parametrize("seed", range(4))
def test_garbage_that_is_within_the_gate_now_and_then_turns_nothing(seed: int) -> None:
    """A magnetometer is believed again where it has not been refused for half a second."""
    random, fusion_, memory = np.random.default_rng(seed), SensorFusion(RTK.tuning, 2), at_start(2)
    begins, ends, last = START + 1.0, START + 4.0, START + 4.7
    fused: list[float] = []
    for now, samples in run(RTK, seed, last - START):
        heard: list[Sample] = []
        for one in samples:
            if isinstance(one, MagneticSample) and begins <= one.time < ends:
                x, y, z = (0.5 * random.standard_normal(3)).tolist()
                one = replace(one, field=(x, y, z))
            heard.append(one)
        memory, _ = fusion_.step(memory, heard, now)
        newest = memory.of(Sensor.MAGNETOMETER).fused
        if newest and newest[0] == now:
            fused.append(now)
    behind = 0.2  # s, as far as the filter stays behind satellites
    assert begins - 0.1 < max(one for one in fused if one < ends) < begins + behind + 0.1
    assert ends + 0.5 - 0.02 < min(one for one in fused if one > ends) < ends + 0.5 + behind


@pytest.mark.requirement("REQ-EST-13")
def test_a_reading_that_waits_is_not_used_once_its_sensor_is_a_suspect() -> None:
    """With the gyro's bias unknown, what a field that had leapt said before it was doubted was let
    pass: it turned the estimate by 29 deg."""
    fusion_, memory, last = SensorFusion(RTK.tuning, 2), at_start(2), START + 1.0
    for now, samples in run(RTK, 0, 1.5):
        doubted = Source.COMPASS if now > last else NOBODY
        memory = replace(memory, verdict=memory.verdict._replace(suspects=doubted))
        memory, _ = fusion_.step(memory, samples, now)
    assert memory.of(Sensor.MAGNETOMETER).fused[0] <= last < memory.of(Sensor.GNSS).fused[0]
    assert memory.of(Sensor.MAGNETOMETER).came > now - 0.1, "it is heard"
