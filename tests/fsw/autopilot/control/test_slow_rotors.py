"""Rotors that are slower than configured: how far the tube stays true, by the linear loop."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from fsw.autopilot.control.gains import TrackingTuning, tracking_gains
from fsw.autopilot.control.tube import WIND_COVERED, limits_used, tube
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.prediction import Array

DT, PUSH = 0.002, 0.8
TUNING = TrackingTuning()
GAINS = tracking_gains(TUNING, AIRFRAME.rotor_lag, DT)


def responses(slower: float, *, wind: bool) -> tuple[Array, Array]:
    """Deviation of the base and the snap that is commanded, after a unit push of one tick.

    p, v, a, j, snap, the observer's v and d, and the snap that the rotor model believes in.
    """
    k, bandwidth, lag = GAINS.k, TUNING.observer_bandwidth, AIRFRAME.rotor_lag
    law = np.array([-k[0], 0.0, -k[2], -k[3], 0.0, -k[1], -GAINS.k_disturbance, -k[4]])
    a, b = np.zeros((8, 8)), np.zeros(8)
    a[:4, 1:5] = np.eye(4)
    a[5, [1, 2, 5, 6]] = 2.0 * bandwidth, 1.0, -2.0 * bandwidth, 1.0
    a[6, [1, 5]] = bandwidth**2, -(bandwidth**2)
    for row, true_lag in ((4, slower * lag), (7, lag)):
        a[row] = law / true_lag
        a[row, row] -= 1.0 / true_lag
        b[row] = (GAINS.k_disturbance - k[2]) / true_lag if wind else 0.0
    b[1] = 0.0 if wind else 1.0
    block = np.zeros((9, 9))
    block[:8, :8], block[:8, 8] = a * DT, b * DT
    exponential = expm(block)
    x, states = exponential[:8, 8], []
    for _ in range(3000):
        states.append(x)
        x = exponential[:8, :8] @ x
    return np.array(states)[:, 0], np.array(states) @ law


def reach_and_torque(slower: float) -> tuple[float, float]:
    """In m, and as a share of what the rotors have."""
    (base, snap), (in_wind, _) = responses(slower, wind=False), responses(slower, wind=True)
    loop = tube(AIRFRAME, TUNING, 0.225, 0.1, DT)
    share = limits_used(AIRFRAME, TUNING, loop, PUSH)["rotor torque"]
    reach = PUSH * np.abs(base).sum() + WIND_COVERED * np.abs(in_wind).sum()
    return float(reach), float(share * np.abs(snap).sum() / loop.snap)


def test_rotors_as_configured_give_the_tube_itself() -> None:
    loop = tube(AIRFRAME, TUNING, 0.225, 0.1, DT)
    reach, torque = reach_and_torque(1.0)
    assert reach == pytest.approx(PUSH * loop.base + loop.base_wind - loop.wind_beyond, rel=1e-6)
    assert torque == pytest.approx(limits_used(AIRFRAME, TUNING, loop, PUSH)["rotor torque"])


def test_to_a_fifth_slower_the_tube_is_proved_and_to_twice_it_is_no_wider_where_linear() -> None:
    assert reach_and_torque(1.2)[1] < 1.0 < reach_and_torque(1.25)[1]
    assert all(reach_and_torque(slower)[0] < 0.071 for slower in (1.2, 1.5, 1.75, 2.0))
    assert reach_and_torque(2.0)[1] == pytest.approx(2.0, abs=0.1), "of the rotors' torque"
    assert reach_and_torque(2.5)[0] > 0.1
