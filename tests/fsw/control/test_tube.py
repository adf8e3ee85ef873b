"""The tube bounds what a disturbance can do to the loop, and no bound below it would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsw.control.inner_tuning import TrackingGains, TrackingTuning, tracking_gains
from fsw.control.tracking import Observed, TrackingLaw, observe, snap_command
from fsw.control.tube import Tube, peak_snap_share, tube
from fsw.model.airframe import AIRFRAME
from fsw.model.prediction import LagModel

DT = 0.002
# Without limits, so that the loop under test is the linear one the bound is about.
TUNING = replace(TrackingTuning(), position_error_limit=1e9, acceleration_limit=1e9, jerk_limit=1e9)


def _gains() -> TrackingGains:
    return tracking_gains(TUNING, AIRFRAME.rotor_lag, DT)


def _tube() -> Tube:
    return tube(AIRFRAME, TUNING, _gains(), hanging=0.225, hold_s=0.1, dt=DT)


def _position_under(disturbance: np.ndarray) -> np.ndarray:
    """One axis of the loop as it is flown, its law called tick by tick."""
    law = TrackingLaw(AIRFRAME, LagModel(), TUNING, _gains())
    decay = np.exp(-DT / AIRFRAME.rotor_lag)
    p = v = a = j = s = 0.0
    believed = Observed((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    positions = []
    for d in disturbance:
        believed = observe(believed, (v, 0.0, 0.0), (a, 0.0, 0.0), TUNING.observer_bandwidth, DT)
        # Far from the jerk limit that the square root sets, snap_command is linear.
        w = snap_command(law, -p, -believed.v[0], -s, believed.d[0], a, j, 0.0, 0.0, 0.0)
        s = w + (s - w) * decay
        p, v, a, j = p + DT * v, v + DT * (a + d), a + DT * j, j + DT * s
        positions.append(p)
    return np.array(positions)


def test_no_random_disturbance_leaves_the_tube() -> None:
    rng = np.random.default_rng(5)
    steps = np.repeat(rng.uniform(-0.8, 0.8, 150), 50)
    assert np.abs(_position_under(steps)).max() < 0.8 * _tube().base


def test_a_lasting_push_stays_inside_and_uses_much_of_it() -> None:
    settled = abs(_position_under(np.full(4000, 0.5))[-1])
    assert 0.6 * 0.5 * _tube().base < settled < 0.5 * _tube().base


def test_the_end_effector_below_swings_further_than_the_base() -> None:
    reach = _tube()
    assert reach.end_effector > reach.base
    assert reach.end_effector_expected > reach.base_expected


def test_what_is_expected_at_random_is_within_the_worst_case() -> None:
    reach = _tube()
    assert reach.base_expected < reach.base
    assert reach.end_effector_expected < reach.end_effector


@pytest.mark.parametrize("cheaper", [0.5, 0.2])
def test_a_cheaper_effort_narrows_the_tube_and_needs_more_snap(cheaper: float) -> None:
    bold = replace(TUNING, effort=TUNING.effort * cheaper)
    reach = tube(AIRFRAME, bold, tracking_gains(bold, AIRFRAME.rotor_lag, DT), 0.225, 0.1, DT)
    assert reach.base < _tube().base
    assert peak_snap_share(AIRFRAME, reach, 0.8) > peak_snap_share(AIRFRAME, _tube(), 0.8)
