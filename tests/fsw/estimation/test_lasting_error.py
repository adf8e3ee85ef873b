"""What is kept of a sensor's own error besides what the filter knows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.estimation.lasting_error import lasting_error
from fsw.estimation.sensor_fusion import FusionMemory, at_start
from fsw.estimation.tuning import EstimatorTuning
from fsw.measurements import GnssSample, PoseSample
from fsw.signals import StateEstimate, Vec3
from tests.fsw.random_states import estimate_of

TUNING = EstimatorTuning()
FINE = (0.003**2, 0.004**2, 0.005**2)
TURN = (0.01**2, 0.02**2, 0.03**2)


def memory(*, drifts: bool = False, seconds: float = 0.0) -> FusionMemory:
    pose = PoseSample(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), FINE, TURN, 0, drifts)
    return at_start()._replace(pose=pose, now=5.0 + seconds, frame_since=5.0)


def at(p: Vec3, turn: Rotation | None = None) -> StateEstimate:
    return estimate_of(turn or Rotation.identity(), p_WB=p)


def deviations(found: np.ndarray) -> list[float]:
    return [math.sqrt(value) for value in np.diag(found)]


def test_a_whole_readings_error_lasts() -> None:
    found = lasting_error(memory(seconds=100.0), TUNING, at((1.0, 2.0, -1.0)))
    assert deviations(found) == pytest.approx([0.003, 0.004, 0.005, 0.01, 0.02, 0.03])


def test_the_attitudes_error_is_turned_from_the_bodys_axes() -> None:
    quarter = Rotation.from_euler("z", 90.0, degrees=True)
    found = lasting_error(memory(), TUNING, at((0.0, 0.0, 0.0), quarter))
    assert deviations(found)[3:] == pytest.approx([0.02, 0.01, 0.03])


def test_odometry_walks_off_with_the_root_of_time_since_its_frame_jumped() -> None:
    found = lasting_error(memory(drifts=True, seconds=16.0), TUNING, at((0.0, 0.0, -1.0)))
    x, _, z, _, _, yaw = deviations(found)
    assert (x, z) == pytest.approx(
        (math.hypot(0.003, 4.0 * TUNING.frame_drift), math.hypot(0.005, 4.0 * TUNING.frame_drift))
    )
    assert yaw == pytest.approx(math.hypot(0.03, 4.0 * TUNING.frame_turn))


def test_a_frame_that_turns_moves_what_is_far_from_its_origin() -> None:
    near, far = (
        lasting_error(memory(drifts=True, seconds=16.0), TUNING, at(p))
        for p in ((0.0, 0.0, 0.0), (10.0, 0.0, 0.0))
    )
    turned = 4.0 * TUNING.frame_turn
    assert far[1, 1] - near[1, 1] == pytest.approx((10.0 * turned) ** 2)
    assert far[1, 5] == pytest.approx(10.0 * turned**2), "east with a positive turn"
    assert far[0, 0] == pytest.approx(near[0, 0])


def test_without_a_pose_satellites_count_and_without_both_nothing() -> None:
    fix = GnssSample(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), FINE, FINE)
    found = lasting_error(at_start()._replace(gnss=fix), TUNING, at((0.0, 0.0, 0.0)))
    assert deviations(found) == pytest.approx([0.003, 0.004, 0.005, 0.0, 0.0, 0.0])
    assert not lasting_error(at_start(), TUNING, at((0.0, 0.0, 0.0))).any()
