"""What is kept of a sensor's own error besides what the filter knows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.estimation.correlated_error import correlated_error
from fsw.autopilot.estimation.drift import FrameDrift
from fsw.autopilot.estimation.error_state import ERRORS
from fsw.autopilot.estimation.faults.sensor_fault import Health
from fsw.autopilot.estimation.fusion_memory import FusionMemory, at_start
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.estimation.turned_covariance import Vec6
from fsw.autopilot.flight.safety.uncertain_clearance import pose_covariance
from fsw.autopilot.measurements import GnssSample, PoseSample, Sensor
from fsw.frozen import replace
from tests.fsw.random_states import estimate_of

TUNING = EstimatorTuning()
FINE = (0.003**2, 0.004**2, 0.005**2)
TURN = (0.01**2, 0.02**2, 0.03**2)


def memory(*, drifts: bool = False) -> FusionMemory:
    pose = PoseSample(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), FINE, TURN, 0, drifts)
    return replace(at_start(2), pose=pose)


def deviations(found: Vec6) -> list[float]:
    return [math.sqrt(value) for value in found]


def test_a_whole_readings_error_lasts() -> None:
    found = correlated_error(memory(), TUNING)
    assert deviations(found) == pytest.approx([0.003, 0.004, 0.005, 0.01, 0.02, 0.03])


def test_the_attitudes_error_is_turned_from_the_bodys_axes() -> None:
    turn = Rotation.from_euler("zyx", (30.0, 20.0, -10.0), degrees=True)
    none, R = np.zeros((ERRORS, ERRORS)), turn.as_matrix()
    found = pose_covariance(none, estimate_of(turn), correlated_error(memory(), TUNING))
    np.testing.assert_allclose(found[3:, 3:], R @ np.diag(TURN) @ R.T, atol=1e-12)


def test_of_odometry_only_its_noise_counts_for_its_drift_is_in_the_covariance() -> None:
    noise = FrameDrift(place_noise=(1e-6, 4e-6, 9e-6), attitude_noise=(16e-6, 25e-6, 36e-6))
    found = correlated_error(replace(memory(drifts=True), frame=noise), TUNING)
    assert deviations(found) == pytest.approx([0.001, 0.002, 0.003, 0.004, 0.005, 0.006])


@pytest.mark.parametrize(("pose_at", "fix_at", "least"), [(2.0, 1.0, 0.003), (1.0, 2.0, 0.01)])
def test_the_position_that_was_used_last_counts(
    pose_at: float, fix_at: float, least: float
) -> None:
    fix = GnssSample(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1e-5, 1e-5, 0.05**2), FINE)
    health = (Health(Sensor.POSE, fused=(pose_at,) * 2), Health(Sensor.GNSS, fused=(fix_at,) * 2))
    both = replace(memory(), gnss=fix, health=health)
    assert deviations(correlated_error(both, TUNING))[0] == pytest.approx(least)


def test_without_a_pose_satellites_count_and_without_both_nothing() -> None:
    fix = GnssSample(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1e-5, 1e-5, 0.05**2), FINE)
    found = correlated_error(replace(at_start(2), gnss=fix), TUNING)
    least = TUNING.gnss.position_floor
    assert deviations(found) == pytest.approx([least, least, 0.05, 0.0, 0.0, 0.0])
    assert not any(correlated_error(at_start(2), TUNING))
