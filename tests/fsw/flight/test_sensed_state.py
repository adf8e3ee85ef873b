"""The estimate from sensors with times of their own, as the tick makes it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fsw.estimation.sensor_fault import Sensor, SensorFault
from fsw.flight.state import FlightState
from fsw.measurements import GnssSample
from tests.fsw.estimation.sensor_runs import MOCAP, RTK, TICK, run
from tests.fsw.flight.test_autopilot import tick


def test_a_first_stamp_ahead_of_all_others_leaves_no_sensor_unused() -> None:
    """The link forgets it; the filter, whose newest readings are of that time, starts anew."""
    state, flown = FlightState(), run(MOCAP, 1, 0.3)
    ahead_s = 100.0
    for k, (now, samples) in enumerate(flown):
        if k == 0:
            now += ahead_s
            samples = [replace(one, time=one.time + ahead_s) for one in samples]
        state, _ = tick(state, round(1e6 * now), samples=tuple(samples))
    assert state.fusion is not None
    assert state.estimate is not None
    assert state.fusion.started
    assert state.fusion.of(Sensor.IMU).fault is SensorFault.NONE
    k = flown.truth.at(now)
    assert state.estimate.p_WB == pytest.approx(flown.truth.p[k], abs=0.02)
    assert 0.0 <= now - state.fusion.imu_came <= TICK


def test_what_lasts_of_a_sensors_error_is_reported_and_no_reason_to_come_down() -> None:
    """Satellites whose errors wander by more than a metre: the filter is surer than any fix."""
    stated = (1.6, 1.7, 4.0)  # m^2
    state = FlightState()
    for now, samples in run(RTK, 1, 3.0):
        told = tuple(
            replace(one, position_variance=stated) if isinstance(one, GnssSample) else one
            for one in samples
        )
        state, _ = tick(state, round(1e6 * now), samples=told)
    report = state.estimator
    assert report is not None
    assert report.level_accuracy > math.sqrt(stated[0] + stated[1])
    assert report.vertical_accuracy > math.sqrt(stated[2])
    assert 0.0 < state.aiding.position_sigma < 0.8
