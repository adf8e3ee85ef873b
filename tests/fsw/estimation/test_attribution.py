"""Who is wrong where poses and the inertial unit contradict each other by little."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fsw.estimation.attribution import (
    Biases,
    Dispute,
    Witness,
    contradicted,
    felt,
    stepped,
    witness,
    wrong,
)
from fsw.estimation.error_state import FILTER, FORCE, LOST, NO_FORCE, TIME
from fsw.estimation.fusion_memory import at_start
from fsw.estimation.sensor_fault import Sensor, SensorFault
from fsw.estimation.sensor_fusion import SensorFusion
from fsw.estimation.tuning import EstimatorTuning
from fsw.measurements import ImuSample, JointSample, PoseSample, Sample
from fsw.signals import Vec3
from tests.fsw.estimation.sensor_runs import TICK, exponential

Array = NDArray[np.float64]
_NONE: Vec3 = (0.0, 0.0, 0.0)
_START, _LIES, _ENDS = 5.0, 6.0, 7.2  # s
_FUSION = SensorFusion(EstimatorTuning())

axes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: math.hypot(*axis) > 0.1)


def along(axis: Vec3, size: float) -> Vec3:
    """A vector of a size [any unit] along an ``axis`` [1]."""
    x, y, z = axis
    scale = size / math.hypot(x, y, z)
    return scale * x, scale * y, scale * z


def plus(a: Vec3, b: Vec3) -> Vec3:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def disputed(seen: Witness | None, *, turned: bool) -> Dispute:
    before = Biases((0.1, -0.05, 0.07), (0.001, -0.002, 0.003), 0.02, 0.001)
    return Dispute(1.0, 1.02, 2, turned, before, seen)


def moved(force: Vec3 = _NONE, rate: Vec3 = _NONE) -> Biases:
    """Biases that have moved by so much since the dispute began."""
    before = disputed(None, turned=False).before
    return Biases(plus(before.force, force), plus(before.rate, rate), 0.1, 0.015)


@given(axes, st.floats(0.5, 100.0), axes, st.floats(0.0, 0.49), st.booleans())
def test_the_unit_is_wrong_if_its_readings_have_changed_as_its_biases_have(
    axis: Vec3, size: float, other: Vec3, share: float, turned: bool
) -> None:
    """Whatever the axis, sign and size, and with a gust of nearly half of it from anywhere."""
    force, gust = along(axis, size), along(other, share * size)
    seen = Witness(plus(force, gust), _NONE)
    if size * (1.0 - share) > 0.3:
        assert wrong(disputed(seen, turned=False), moved(force=force)) is Sensor.IMU
    # An accelerometer does not explain that an attitude was refused.
    assert wrong(disputed(seen, turned=True), moved(force=force)) is Sensor.POSE
    rate = along(axis, 0.2 * size)
    seen = Witness(gust, plus(rate, along(other, 0.2 * share * size)))
    assert wrong(disputed(seen, turned=turned), moved(rate=rate)) is Sensor.IMU


@given(axes, st.floats(0.01, 100.0), axes, st.floats(0.0, 0.49), st.booleans())
def test_the_pose_is_wrong_if_readings_have_not_changed_as_biases_have(
    axis: Vec3, size: float, other: Vec3, share: float, turned: bool
) -> None:
    """Poses that run away move the biases; what is seen meanwhile are gusts of less than half."""
    force, rate = along(axis, size), along(axis, 0.2 * size)
    seen = Witness(along(other, share * size), along(other, 0.2 * share * size))
    assert wrong(disputed(seen, turned=turned), moved(force, rate)) is Sensor.POSE
    against = Witness(along(axis, -size), along(axis, -size))
    assert wrong(disputed(against, turned=turned), moved(force, rate)) is Sensor.POSE
    assert wrong(disputed(None, turned=turned), moved(force, rate)) is Sensor.POSE


def test_biases_that_have_not_moved_or_are_no_numbers_are_no_evidence() -> None:
    seen = Witness((3.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    dispute = disputed(seen, turned=False)
    assert wrong(dispute, moved()) is Sensor.POSE
    none = (math.nan, 0.0, 0.0)
    assert wrong(dispute, Biases(none, none, 0.1, 0.1)) is Sensor.POSE
    unsure = moved((3.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    unsure = unsure._replace(force_sigma=1.0, rate_sigma=0.2)
    assert wrong(dispute, unsure) is Sensor.POSE, "still within three standard deviations"


def test_a_dispute_is_settled_when_the_biases_are_known_anew_and_soon_in_any_case() -> None:
    x = np.zeros(1, FILTER)[0]
    one = contradicted(None, 1.0, x, turned=True)
    assert one.turned
    assert not one.is_due(1.5), "a single pose moves no bias at once"
    assert one.is_due(1.7)
    more = contradicted(one, 1.1, x, turned=False)
    assert more.turned, "what the first one contradicted counts"
    assert more.before == one.before
    assert not more.is_due(1.29)
    assert more.is_due(1.31)
    assert not more.is_over(3.0)
    assert more.is_over(3.2)


def test_a_step_of_the_gyro_opens_a_dispute_that_the_first_refused_pose_takes_over() -> None:
    x = np.zeros(1, FILTER)[0]
    x["step"], x["stepped"] = (0.3, 0.0, -0.1), 1.0
    one = stepped(None, x)
    assert one.witness is not None
    assert one.witness.rate == pytest.approx((0.3, 0.0, -0.1))
    assert stepped(one, x) is one, "told once"
    x["step"], x["stepped"], x["gyro_bias"] = (0.4, 0.0, -0.1), 1.1, (0.2, 0.0, 0.0)
    more = stepped(one, x)
    assert more.witness is not None
    assert more.witness.rate == pytest.approx((0.4, 0.0, -0.1)), "steps that follow are one"
    assert more.before == one.before
    x["stepped"] = 1.7
    assert stepped(more, x).before.rate == (0.2, 0.0, 0.0), "later ones are not"
    poses = contradicted(more, 1.2, x, turned=False)
    assert (poses.since, poses.refused, poses.turned) == (1.2, 1, False)
    assert poses.before == one.before
    assert stepped(poses, x) is poses


def test_readings_that_are_lost_and_rotors_that_are_not_known_bear_no_witness() -> None:
    x = np.zeros(1, FILTER)[0]
    x["end"] = 4
    for k in range(4):
        x["imu"][k, TIME], x["imu"][k, FORCE : FORCE + 3] = TICK * k, (1.0, -2.0, -6.0)
    x["step"], x["stepped"] = (0.3, 0.0, -0.1), 1.0
    before = Biases((0.1, 0.0, 0.0), _NONE, 0.02, 0.001)
    seen = witness(x, 1.5)
    assert seen.rate == pytest.approx((0.3, 0.0, -0.1))
    assert witness(x, 2.1) == Witness(), "long ago"
    assert felt(seen, x, before, _NONE) == seen
    once = felt(seen, x, before, (0.0, 0.0, 9.0))
    assert once.force == pytest.approx((0.9, -2.0, 3.0))
    assert felt(once, x, before, (0.0, 0.0, 8.0)).force == pytest.approx((0.9, -2.0, 2.5)), "mean"
    x["imu"][:, LOST] = NO_FORCE
    assert felt(once, x, before, (0.0, 0.0, 9.0)) == once


# ---------------------------------------------------------------- through the whole estimator


class Lie:
    """What is wrong from ``_LIES`` on."""

    def __init__(
        self,
        force: Vec3 = _NONE,
        rate: Vec3 = _NONE,
        place: Vec3 = _NONE,
        speed: Vec3 = _NONE,
        turn: Vec3 = _NONE,
        turning: Vec3 = _NONE,
    ) -> None:
        self.force, self.rate, self.place, self.speed = force, rate, place, speed
        self.turn, self.turning = turn, turning

    def told(self, sample: Sample) -> Sample:
        if sample.time < _LIES:
            return sample
        since = sample.time - _LIES
        if isinstance(sample, ImuSample):
            force, rate = plus(sample.acceleration, self.force), plus(sample.rate, self.rate)
            return replace(sample, acceleration=force, rate=rate)
        if isinstance(sample, PoseSample):
            off = np.add(self.place, np.multiply(since, self.speed))
            turn = np.add(self.turn, np.multiply(since, self.turning))
            position = tuple(np.add(sample.position, off).tolist())
            # The attitude of a vehicle that hovers level is small: turns add.
            attitude = tuple(exponential((2.0 * np.array(sample.attitude[1:]) + turn)[None])[0])
            return replace(sample, position=position, attitude=attitude)
        return sample


def hover(lie: Lie, seed: int, gust: float = 0.0) -> tuple[set[tuple[Sensor, SensorFault]], float]:
    """Faults that are found where one hovers and something lies, and when the first one was [s].

    A ``gust`` [m/s^2] pushes to and fro, which accelerometer and poses know and the rotors do not.
    """
    random, memory, found, first = np.random.default_rng(seed), at_start(), set(), math.inf
    direction, swing = random.standard_normal(3), 4.0
    direction *= gust / np.linalg.norm(direction)
    due: list[tuple[float, PoseSample]] = []
    next_pose = _START
    for k in range(round((_ENDS - _START) / TICK)):
        now = _START + TICK * k
        phase = swing * (now - _START)
        push = direction * math.sin(phase)
        force = push + (0.0, 0.0, -9.81) + 0.4 * random.standard_normal(3)
        rate = 0.012 * random.standard_normal(3)
        samples: list[Sample] = [
            ImuSample(now, tuple(force.tolist()), tuple(rate.tolist())),
            JointSample(now, (0.3, -0.2)),
        ]
        if now >= next_pose:
            next_pose += 1.0 / 120.0
            place = direction * (phase - math.sin(phase)) / swing**2
            place = place + 5e-4 * random.standard_normal(3)
            attitude = exponential(3.5e-3 * random.standard_normal((1, 3)))[0]
            noise, about = (2.5e-7,) * 3, (1.2e-5,) * 3
            pose = PoseSample(now, tuple(place.tolist()), tuple(attitude.tolist()), noise, about)
            due.append((now + 0.015, pose))
        while due and due[0][0] <= now:
            samples.append(due.pop(0)[1])
        told = [lie.told(sample) for sample in samples]
        memory, _ = _FUSION.step(memory, told, now, model=(0.0, 0.0, 9.81))
        for health in memory.health:
            if health.fault and health.fault_at == now:
                found.add((health.sensor, health.fault))
                first = min(first, now - _LIES)
    return found, first


_AXES: tuple[Any, ...] = (
    *((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)),
    *((1, -1, 2), (-5, 3, -2)),
)
_IMU = {(Sensor.IMU, SensorFault.DISAGREES)}
_POSE = {(Sensor.POSE, SensorFault.JUMP)}


@pytest.mark.parametrize("size", [0.15, 0.6, 0.9])
@pytest.mark.parametrize("axis", _AXES, ids=str)
def test_a_gyro_off_by_a_constant_is_named_and_the_pose_is_not(axis: Vec3, size: float) -> None:
    found, first = hover(Lie(rate=along(axis, size)), 1, gust=0.5)
    assert found == _IMU
    assert first < 0.2


@pytest.mark.parametrize("size", [2.5, 10.0])
@pytest.mark.parametrize("axis", [_AXES[0], _AXES[6]], ids=str)
def test_a_gyro_off_by_much_is_named_at_once_and_the_pose_is_not(axis: Vec3, size: float) -> None:
    found, first = hover(Lie(rate=along(axis, size)), 1, gust=0.5)
    assert found == {(Sensor.IMU, SensorFault.JUMP)}
    assert first < 0.01


@pytest.mark.parametrize("size", [2.5, 8.0, 25.0])
@pytest.mark.parametrize("axis", _AXES, ids=str)
def test_an_accelerometer_off_by_a_constant_is_named_and_the_pose_is_not(
    axis: Vec3, size: float
) -> None:
    found, first = hover(Lie(force=along(axis, size)), 1, gust=0.5)
    assert found == _IMU
    assert first < 0.7


@pytest.mark.parametrize(
    "axis",
    [_AXES[0], *(pytest.param(axis, marks=pytest.mark.long) for axis in _AXES[1:7]), _AXES[7]],
    ids=str,
)
def test_poses_that_jump_or_run_away_are_named_and_the_unit_is_not(axis: Vec3) -> None:
    lies = [
        *(Lie(place=along(axis, size)) for size in (0.01, 0.04, 1.0)),
        *(Lie(speed=along(axis, size)) for size in (0.2, 1.0)),
        *(Lie(turn=along(axis, size)) for size in (0.03, 0.09, 0.4)),
        *(Lie(turning=along(axis, size)) for size in (0.2, 0.8)),
    ]
    for lie in lies:
        found, _ = hover(lie, 2, gust=0.5)
        assert found == _POSE


def test_without_a_lie_nothing_is_told() -> None:
    assert hover(Lie(), 3, gust=0.8) == (set(), math.inf)
