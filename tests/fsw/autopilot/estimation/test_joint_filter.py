"""Joints of the present, from encoders that may be late, few or wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from fsw.autopilot.estimation.error_state import FILTER
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.estimation.joint_filter import begin, present_joints, push, read
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.signals import Vec2

TUNING = EstimatorTuning()
LAW = TUNING
TICK = 0.002
STEP = 1.534e-3  # rad, of an encoder
Spoil = Callable[[float, Vec2], Vec2 | None]


def empty_filter(joints: int = 2) -> Any:
    x: Any = np.zeros(1, FILTER).view(np.recarray)[0]
    x.joint_count = joints
    return x


def present(x: Any, now: float) -> tuple[list[float], list[float]]:
    """Angles and rates of the joints."""
    angles, rates = np.zeros(x.joint_count), np.zeros(x.joint_count)
    present_joints(x, now, angles, rates)
    return angles.tolist(), rates.tolist()


def angle(t: float) -> float:
    return 0.4 * math.sin(5.0 * t)


def rate(t: float) -> float:
    return 2.0 * math.cos(5.0 * t)


def believed(t: float) -> float:
    """What the torques would make of a joint [rad/s^2], which friction of 3 rad/s^2 holds back."""
    return -10.0 * math.sin(5.0 * t) + 3.0


class Arm:
    """Two joints that swing, one against the other."""

    def __init__(self, age: float = 0.0, every: int = 1, spoil: Spoil = lambda _, a: a) -> None:
        self.x = empty_filter()
        begin(self.x, LAW, 0.0, (0.0, 0.0))
        self.faults: set[SensorFault] = set()
        self.error, self.off = 0.0, 0.0
        for k in range(1, 1000):
            now = TICK * k
            u = believed(now - 0.5 * TICK)
            push(self.x, LAW, now, TICK, np.array((u, -u)))
            seen = round(angle(now - age) / STEP) * STEP
            said = spoil(now, (seen, -seen))
            if now > age and k % every == 0 and said is not None:
                fault = SensorFault(read(self.x, LAW, now, np.array(said), age))
                if fault:
                    self.faults.add(fault)
            (q1, q2), (w1, w2) = present(self.x, now)
            if now > 1.0:
                self.error = max(self.error, abs(q1 - angle(now)), abs(q2 + angle(now)))
                self.off = max(self.off, abs(w1 - rate(now)), abs(w2 + rate(now)))


@pytest.mark.drawn(2)
@pytest.mark.parametrize(
    ("age", "error", "off"), [(0.0, 2e-3, 0.2), (0.014, 5e-3, 0.3), (0.04, 0.02, 0.8)]
)
def test_readings_that_are_late_are_brought_to_the_present(
    age: float, error: float, off: float
) -> None:
    arm = Arm(age)
    assert not arm.faults
    assert arm.error < error
    assert arm.off < off


def test_readings_that_are_few_do_not_make_it_swing() -> None:
    arm = Arm(every=25)
    assert not arm.faults
    assert arm.error < 0.1


def test_the_covariance_settles_where_the_riccati_equation_says() -> None:
    arm, h = Arm(), TICK
    move = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    seen, noise = np.array([[1.0, 0.0, 0.0]]), TUNING.encoder_noise**2
    rows = [
        [h**5 / 20, h**4 / 8, h**3 / 6],
        [h**4 / 8, h**3 / 3, h**2 / 2],
        [h**3 / 6, h**2 / 2, h],
    ]
    walk = TUNING.joint_disturbance_walk**2 * np.array(rows)
    P = solve_discrete_are(move.T, seen.T, walk, np.array([[noise]]))
    after = P - P @ seen.T @ seen @ P / (P[0, 0] + noise)
    np.testing.assert_allclose(arm.x.joint_variance, after, rtol=1e-6)


def test_garbage_is_not_believed_and_the_torques_carry_on() -> None:
    random = np.random.default_rng(3)

    def garbage(now: float, _: Vec2) -> Vec2:
        a, b = random.uniform(-math.pi, math.pi, 2).tolist()
        return a, b

    arm = Arm(spoil=lambda now, said: garbage(now, said) if now > 1.5 else said)
    assert arm.faults == {SensorFault.JUMP}
    assert arm.error < 0.15, "of friction that is not modelled, in half a second"


@pytest.mark.drawn(1)
@pytest.mark.parametrize("by", [(0.2, 0.0), (0.0, -1.3), (0.3, 0.3), (1.0, -2.0)])
@pytest.mark.parametrize("until", [1.52, 1.8, 3.0])
def test_a_zero_that_has_moved_is_named_and_the_joint_is_followed_on(
    by: tuple[float, float], until: float
) -> None:
    def spoil(now: float, said: Vec2) -> Vec2:
        return (said[0] + by[0], said[1] + by[1]) if 1.5 < now < until else said

    arm = Arm(spoil=spoil)
    assert arm.faults == {SensorFault.JUMP}
    assert arm.error < 0.03
    np.testing.assert_allclose(arm.x.encoder_zero[:2], by if until > 2.0 else (0.0, 0.0), atol=0.02)


@pytest.mark.drawn(2)
@pytest.mark.parametrize("sigma", [0.05, 0.1, 0.3, 1.3])
def test_noise_of_a_tenth_of_a_second_makes_no_joint_run_away(sigma: float) -> None:
    random = np.random.default_rng(5)

    def spoil(now: float, said: Vec2) -> Vec2:
        a, b = random.normal(0.0, sigma, 2).tolist()
        return (said[0] + a, said[1] + b) if 1.5 < now < 1.6 else said

    arm = Arm(spoil=spoil)
    assert arm.error < 1.2, "5 rad and more if each reading within the gate is believed as it is"
    assert arm.off < 16.0


@pytest.mark.drawn(1)
@pytest.mark.parametrize("bounce", [0.0, 0.5])
def test_a_joint_without_torque_that_swings_to_its_end_stop_is_followed(bounce: float) -> None:
    """At 45 rad/s, within 15 ms, as one whose drive is dead; its zero stays where it was."""
    spin_up, fast, stop = 0.015, 45.0, 2.0  # s, rad/s, rad

    def swing(t: float) -> float:
        rising = min(max(t, 0.0), spin_up)
        angle = fast * (0.5 * rising**2 / spin_up + max(t - spin_up, 0.0))
        return angle if angle < stop else stop - bounce * min(angle - stop, 0.4)

    arm = Arm(spoil=lambda now, said: (said[0], said[1] + swing(now - 1.5)))
    assert not arm.faults
    assert not any(arm.x.encoder_zero)
    (_, q2), _ = present(arm.x, TICK * 999)
    end = swing(TICK * 999 - 1.5) - angle(TICK * 999)
    assert q2 == pytest.approx(end, abs=0.01)


def test_after_garbage_the_zero_is_where_it_was() -> None:
    random = np.random.default_rng(4)

    def spoil(now: float, said: Vec2) -> Vec2:
        a, b = random.uniform(-math.pi, math.pi, 2).tolist()
        return (a, b) if 1.3 < now < 1.6 else said

    arm = Arm(spoil=spoil)
    assert not np.any(arm.x.encoder_zero)
    (q1, q2), _ = present(arm.x, TICK * 999)
    assert abs(q1 - angle(TICK * 999)) + abs(q2 + angle(TICK * 999)) < 0.01


def test_a_reading_again_and_one_older_than_the_state_are_named() -> None:
    arm = Arm()
    now = TICK * 1000
    assert SensorFault(read(arm.x, LAW, now, np.zeros(2), TICK)) is SensorFault.REPEATED
    assert all(np.isfinite(np.ravel(arm.x.joints)))


@pytest.mark.requirement("REQ-ACT-4")
@pytest.mark.parametrize("falls", [150.0, 400.0])
def test_a_joint_that_falls_as_no_torque_makes_it_is_followed_and_is_no_jump(falls: float) -> None:
    """Encoders were blamed for a limp joint, and joints are not judged without encoders."""
    x = empty_filter()
    begin(x, LAW, 0.0, (0.0, 0.0))
    q, w, worst = 0.0, 0.0, 0.0
    for k in range(1, 650):
        now = TICK * k
        a = falls if now > 1.0 and w < 8.0 else 0.0
        q, w = q + TICK * (w + 0.5 * TICK * a), w + TICK * a
        push(x, LAW, now, TICK, np.zeros(2))
        seen = round(q / STEP) * STEP
        assert read(x, LAW, now, np.array((seen, -0.5 * seen)), 0.0) == SensorFault.NONE
        (first, _), _ = present(x, now)
        worst = max(worst, abs(first - q))
    assert worst < 0.12


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("sigma", [0.01, 0.03])
def test_noise_of_an_encoder_is_no_motion_and_it_is_known_how_large_it_is(sigma: float) -> None:
    """The rates that noise made threw an arm into a wall."""
    noise = np.random.default_rng(7)

    def noisy(t: float, said: Vec2) -> Vec2:
        return (said[0] + float(noise.normal(0.0, sigma)), said[1]) if t > 0.5 else said

    arm = Arm(spoil=noisy)
    assert SensorFault.JUMP not in arm.faults
    assert arm.off < 3.0
    scale = float(arm.x.encoder_scale)
    assert 0.2 * sigma < math.sqrt(scale) * TUNING.encoder_noise < 3.0 * sigma
    assert Arm().x.encoder_scale == 1.0


@pytest.mark.drawn(2)
@pytest.mark.parametrize("joints", [1, 4, 6])
def test_each_of_any_number_of_joints_is_followed(joints: int) -> None:
    x, worst = empty_filter(joints), 0.0
    begin(x, LAW, 0.0, (0.0,) * joints)
    share = np.linspace(-1.0, 0.5, joints)
    for k in range(1, 1000):
        now = TICK * k
        push(x, LAW, now, TICK, believed(now - 0.5 * TICK) * share)
        assert read(x, LAW, now, angle(now) * share, 0.0) == SensorFault.NONE
        if now > 1.0:
            worst = max(worst, float(np.abs(present(x, now)[0] - angle(now) * share).max()))
    assert worst < 2e-3
    assert not np.any(x.joints[joints:])
