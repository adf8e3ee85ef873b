"""The tracking gains are those of the cheapest linear feedback of the chains they are made for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete

from fsw.autopilot.control.gains import LoopGains, TrackingTuning, tracking_gains
from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY
from fsw.autopilot.model.prediction import Array
from tests.paper_vehicle import YAW_PER_THRUST

DT = 0.002
# Prices and lags unlike the flown ones: the design must follow them.
TUNINGS = [
    TrackingTuning(),
    replace(TrackingTuning(), input_weight=4e-7, point_below_base=0.3, vertical_input_weight=1e-5),
    replace(TrackingTuning(), disturbance_correlation=0.4),
]


def cheapest(a: Array, b: Array, price: Array, input_weight: float) -> Array:
    """The gain of a sampled chain by value iteration: the cost of ever longer flights."""
    ad, bd, *_ = cont2discrete((a, b, np.eye(len(a)), np.zeros_like(b)), DT)
    value = price
    for _ in range(6000):
        gain = bd.T @ value @ ad / (input_weight + bd.T @ value @ bd)
        value = price + ad.T @ value @ (ad - bd @ gain)
    return np.asarray(gain[0])


@pytest.mark.drawn(2)
@pytest.mark.parametrize("tuning", TUNINGS)
@pytest.mark.parametrize("lag", [0.04, 0.1])
def test_the_horizontal_gains_are_the_cheapest(tuning: TrackingTuning, lag: float) -> None:
    # Position is the integral of velocity and so on down to snap, which follows its command with
    # the rotors' lag; a disturbance that fades pushes the velocity.
    a, b = np.zeros((6, 6)), np.zeros((6, 1))
    for derivative in range(4):
        a[derivative, derivative + 1] = 1.0
    a[4, 4], b[4, 0] = -1.0 / lag, 1.0 / lag
    a[1, 5], a[5, 5] = 1.0, -1.0 / tuning.disturbance_correlation
    # A vehicle that accelerates leans, and what hangs below it swings back.
    point = np.array([1.0, 0.0, -tuning.point_below_base / GRAVITY, 0.0, 0.0, 0.0])
    expected = cheapest(a, b, np.outer(point, point), tuning.input_weight)
    gains = tracking_gains(tuning, lag, DT)
    np.testing.assert_allclose((*gains.k, gains.k_disturbance), expected, rtol=1e-5)


@pytest.mark.parametrize("tuning", TUNINGS)
def test_the_vertical_gains_are_the_cheapest(tuning: TrackingTuning) -> None:
    a, b, lag = np.zeros((4, 4)), np.zeros((4, 1)), 0.07
    a[0, 1] = a[1, 2] = a[1, 3] = 1.0
    a[2, 2], b[2, 0] = -1.0 / lag, 1.0 / lag
    a[3, 3] = -1.0 / tuning.vertical_disturbance_correlation
    expected = cheapest(a, b, np.diag([1.0, 0.0, 0.0, 0.0]), tuning.vertical_input_weight)
    gains = tracking_gains(tuning, lag, DT)
    got = (*gains.k_vertical, gains.k_vertical_disturbance)
    np.testing.assert_allclose(got, expected, rtol=1e-5)


@pytest.mark.parametrize("loop", ["attitude", "height", "joint"])
def test_each_pid_of_the_paper_settles_a_double_integrator_without_ringing(loop: str) -> None:
    """All poles of s^3 + kd s^2 + kp s + ki decay, none swings more than it decays."""
    gains = getattr(LoopGains(), loop)
    poles = np.roots([1.0, gains.kd, gains.kp, gains.ki][: 4 if gains.ki else 3])
    assert poles.real.max() < 0.0
    assert np.abs(poles.imag / poles.real).max() < 4.0 / 3.0  # damping of 0.6


def test_the_heading_loop_is_critically_damped_and_cannot_spend_all_the_rotors_drag() -> None:
    tuning = LoopGains()
    assert np.roots([1.0, tuning.yaw.kd, tuning.yaw.kp]) == pytest.approx([-2.0, -2.0])
    drag = 4.0 * YAW_PER_THRUST * tuning.yaw_thrust_limit / AIRFRAME.bodies.base_inertia[2]
    assert tuning.yaw.ki == 0.0
    assert drag < 2.0 * tuning.yaw.limit
