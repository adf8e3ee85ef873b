"""A gyro that jumps: what an attitude or the Earth's field that is measured afterwards decides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fsw.compiled import packed
from fsw.estimation.claim import judge_by_attitude, judge_by_field, turns
from fsw.estimation.error_state import CLAIMS, FILTER, IMU_CAPACITY, LOST, NO_RATE, RATE
from fsw.estimation.imu import STAYS, add_imu
from fsw.estimation.sensor_fault import SensorFault
from fsw.estimation.tuning import EstimatorTuning
from fsw.geometry.quaternion import conjugate, multiply, rotation_vector, turned
from fsw.geometry.rotation import matrix_from_quaternion, rotate_back
from fsw.signals import Vec3, Vec4

TUNING = EstimatorTuning()
LAW = packed(TUNING).view(np.recarray)[0]
TICK = 0.002
IN_FLIGHT = (0.0, 0.0, 9.81)  # the rotors' model: no turning, hover
SIGMA = 3.5e-3  # rad, of a pose of `mocap`
FIELD = (0.2148, 0.0109, 0.4321)  # Gauss, NED


class Body:
    """A body that turns, its gyro, and a filter at the time of the first reading."""

    def __init__(self) -> None:
        self.x: Any = np.zeros(1, FILTER).view(np.recarray)[0]
        self.x.q[0] = 1.0
        self.random = np.random.default_rng(1)
        self.now = 1.0
        self.q: Vec4 = (1.0, 0.0, 0.0, 0.0)
        self.rate = np.zeros(3)
        self.off = np.zeros(3)  # of the gyro
        for k in range(300):
            self.read()
            if k == 280:
                self.x.first, self.x.time = self.x.end, self.now

    def read(self, model: Vec3 = IN_FLIGHT) -> SensorFault:
        """Go on for a tick; the rates may be other ones now. What is wrong with the reading."""
        self.now += TICK
        a, b, c = TICK * self.rate
        self.q = turned(self.q, a, b, c)
        w: Vec3 = tuple((self.rate + self.off + 0.01 * self.random.standard_normal(3)).tolist())  # type: ignore[assignment]
        f: Vec3 = (0.0, 0.0, -9.81 + 0.1 * float(self.random.standard_normal()))
        return SensorFault(add_imu(self.x, LAW, self.now, self.now, f, w, model))

    def pose(self) -> bool:
        """An attitude that was measured now."""
        a, b, c = SIGMA * self.random.standard_normal(3)
        return bool(judge_by_attitude(self.x, self.now, turned(self.q, a, b, c), SIGMA))

    def field(self) -> bool:
        """A field that was measured now."""
        said = rotate_back(matrix_from_quaternion(self.q), FIELD)
        noisy: Vec3 = tuple((said + 0.0032 * self.random.standard_normal(3)).tolist())  # type: ignore[assignment]
        return bool(judge_by_field(self.x, TUNING.mag_noise, self.now, noisy))

    def fly(self, seconds: float, every: float, *, by_field: bool = False) -> float:
        """Time [s] until the gyro is believed, with a measurement ``every`` so often; or inf."""
        ticks = round(every / TICK)
        for k in range(1, round(seconds / TICK) + 1):
            self.read()
            if self.x.doubted[1] == 0:
                return k * TICK
            if k % ticks == 0 and (self.field() if by_field else self.pose()):
                return k * TICK
        return np.inf


def one_axis(axis: int, size: float) -> Any:
    vector = np.zeros(3)
    vector[axis] = size
    return vector


@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.parametrize(("axis", "size"), [(0, 3.0), (0, -10.0), (1, 25.0), (2, -3.0), (2, 10.0)])
@pytest.mark.parametrize(
    ("every", "by_field"),
    [
        pytest.param(0.008, False, id="120", marks=pytest.mark.long),
        pytest.param(0.034, False, id="30"),
        pytest.param(0.02, True, id="mag"),
    ],
)
def test_a_gyro_that_is_off_for_good_is_not_believed_because_it_is_steady(
    axis: int, size: float, every: float, by_field: bool
) -> None:
    body = Body()
    body.off = one_axis(axis, size)
    assert body.fly(0.7, every, by_field=by_field) == np.inf
    last = body.x.imu[(body.x.end - 1) % IMU_CAPACITY]
    assert int(last[LOST]) & NO_RATE
    assert np.abs(last[RATE : RATE + 3]).max() < 0.2, "the rotors' model is flown"
    body.off = np.zeros(3)
    assert body.fly(0.5, every, by_field=by_field) < 0.3, "right again"


@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.parametrize(("axis", "size"), [(0, 3.0), (0, -10.0), (1, 5.0), (2, 3.0)])
@pytest.mark.parametrize(
    ("every", "by_field", "within"),
    [(0.008, False, 0.034), (0.034, False, 0.036), (0.02, True, 0.26)],
    ids=["120", "30", "mag"],
)
def test_a_blow_that_turns_the_body_is_believed_and_what_was_flown_put_right(
    axis: int, size: float, every: float, by_field: bool, within: float
) -> None:
    body = Body()
    body.rate = one_axis(axis, size)
    assert body.read() is SensorFault.JUMP
    assert body.fly(1.0, every, by_field=by_field) <= within
    q: Vec4 = (1.0, 0.0, 0.0, 0.0)
    for k in range(body.x.first, body.x.end):  # as the filter would
        row = body.x.imu[k % IMU_CAPACITY]
        assert int(row[LOST]) == 0
        a, b, c = TICK * row[RATE : RATE + 3]
        q = turned(q, a, b, c)
    missed = rotation_vector(multiply(conjugate(q), body.q))
    assert np.linalg.norm(missed) < 0.03
    assert body.read() is SensorFault.NONE


def test_a_blow_that_the_filter_has_passed_turns_its_attitude_and_says_that_it_may_be_wrong() -> (
    None
):
    body = Body()
    body.rate = one_axis(1, 5.0)
    for _ in range(20):
        body.read()
    x, there = body.x, body.q
    x.first, x.time = x.end, body.now  # with the model's rates, so its attitude is that of before
    for _ in range(3):
        body.read()
    assert body.pose()
    missed = rotation_vector(multiply(conjugate(tuple(x.q.tolist())), there))
    assert np.linalg.norm(missed) < 0.02
    assert min(np.diagonal(x.covariance)[3:9]) > 0.0


def test_without_a_measurement_it_stays_lost_and_one_that_comes_back_soon_is_believed() -> None:
    body = Body()
    body.off = one_axis(0, 10.0)
    for _ in range(2 * CLAIMS):
        assert body.read() is SensorFault.JUMP
    assert not turns(body.x, body.now - 2.0 * CLAIMS * TICK, body.now)[0], "too long ago"
    body = Body()
    body.off = one_axis(0, 10.0)
    assert body.read() is SensorFault.JUMP
    body.off = np.zeros(3)
    assert body.read() is SensorFault.NONE


def test_on_the_ground_nobody_measures_and_what_is_steady_is_believed() -> None:
    body = Body()
    body.off = one_axis(0, 10.0)
    unknown = (0.0, 0.0, 0.0)
    faults = [body.read(unknown) for _ in range(STAYS + 1)]
    assert faults == [SensorFault.JUMP] * STAYS + [SensorFault.NONE]


def test_a_gyro_that_has_turned_once_round_is_not_right() -> None:
    """The attitude is then what it was."""
    body = Body()
    body.off = one_axis(2, 31.4)
    assert body.fly(0.8, 0.2) == np.inf
