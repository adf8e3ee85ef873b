"""The tube bounds what a disturbance can do to the loop, and no bound below it would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsw.control.gains import TrackingGains, TrackingTuning, tracking_gains
from fsw.control.tracking import AxisState, Observed, TrackingLaw, observe, snap_command
from fsw.control.tube import Tube, peak_snap_share, tube
from fsw.model.airframe import AIRFRAME

DT = 0.002
# Without limits, so that the loop under test is the linear one the bound is about.
TUNING = replace(TrackingTuning(), position_error_limit=1e9, acceleration_limit=1e9, jerk_limit=1e9)
REST = AxisState(0.0, 0.0, 0.0, 0.0, 0.0)


def _gains() -> TrackingGains:
    return tracking_gains(TUNING, AIRFRAME.rotor_lag, DT)


def _tube() -> Tube:
    return tube(AIRFRAME, TUNING, _gains(), hanging=0.225, hold_s=0.1, dt=DT)


def _position_under(disturbance: np.ndarray, tuning: TrackingTuning = TUNING) -> np.ndarray:
    """One axis of the loop as it is flown, its law called tick by tick."""
    law = TrackingLaw(AIRFRAME.attitude_lag, tuning, _gains())
    decay = np.exp(-DT / AIRFRAME.rotor_lag)
    p = v = a = j = s = 0.0
    believed = Observed((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    positions = []
    for d in disturbance:
        believed = observe(believed, (v, 0.0, 0.0), (a, 0.0, 0.0), tuning, DT)
        # Far from the jerk limit that the square root sets, snap_command is linear.
        d_hat, lasting = believed.d[0], believed.disturbance_bias[0]
        w = snap_command(law, AxisState(p, believed.v[0], a, j, s), d_hat, lasting, REST, 0.0)
        s = w + (s - w) * decay
        p, v, a, j = p + DT * v, v + DT * (a + d), a + DT * j, j + DT * s
        positions.append(p)
    return np.array(positions)


def test_no_random_disturbance_leaves_the_tube() -> None:
    rng = np.random.default_rng(5)
    steps = np.repeat(rng.uniform(-0.8, 0.8, 150), 50)
    assert np.abs(_position_under(steps)).max() < 0.8 * _tube().base + _tube().base_wind


def test_a_lasting_push_stays_inside_and_uses_much_of_it() -> None:
    forgetful = replace(TUNING, wind_limit=0.0)
    settled = abs(_position_under(np.full(4000, 0.5), forgetful)[-1])
    assert 0.6 * 0.5 * _tube().base < settled < 0.5 * _tube().base


def test_wind_within_the_limit_ends_without_an_offset() -> None:
    """And more than that with what the limit leaves."""
    limit = TUNING.wind_limit
    assert abs(_position_under(np.full(15_000, 0.9 * limit))[-1]) < 0.5e-3
    forgetful = _position_under(np.full(15_000, 0.5 - limit), replace(TUNING, wind_limit=0.0))
    believed = _position_under(np.full(15_000, 0.5))
    assert believed[-1] == pytest.approx(forgetful[-1], abs=1e-5)


def test_a_push_that_turns_once_it_is_taken_for_wind_needs_the_wider_tube() -> None:
    """The memory of one push is added to the opposite one."""
    push = np.concatenate((np.full(10_000, -0.8), np.full(1000, 0.8)))
    reach = np.abs(_position_under(push)).max()
    assert 0.8 * _tube().base < reach < 0.8 * _tube().base + _tube().base_wind


@pytest.mark.parametrize("cheaper", [0.5, 0.2])
def test_a_cheaper_effort_narrows_the_tube_and_needs_more_snap(cheaper: float) -> None:
    bold = replace(TUNING, input_weight=TUNING.input_weight * cheaper)
    reach = tube(AIRFRAME, bold, tracking_gains(bold, AIRFRAME.rotor_lag, DT), 0.225, 0.1, DT)
    assert reach.base < _tube().base
    assert peak_snap_share(AIRFRAME, reach, 0.8) > peak_snap_share(AIRFRAME, _tube(), 0.8)
