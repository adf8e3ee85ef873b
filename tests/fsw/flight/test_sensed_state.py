"""The estimate from sensors with times of their own, as the tick makes it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.estimation.sensor_fault import Sensor, SensorFault
from fsw.flight.state import FlightState
from fsw.measurements import JointSample, PoseSample
from tests.fsw.estimation.sensor_runs import MOCAP, TICK, run
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


def test_before_the_first_estimate_looks_at_sensors_are_as_rare_as_after_it() -> None:
    """Without encoders there is none; the pose comes for a while, and then no more."""
    state, told = FlightState(), []
    for now, samples in run(MOCAP, 1, 2.5):
        heard = [
            one
            for one in samples
            if not isinstance(one, JointSample)
            and not (isinstance(one, PoseSample) and one.time > 6.5)
        ]
        state, outputs = tick(state, round(1e6 * now), samples=tuple(heard))
        told += [text.text for text in outputs.texts]
    assert state.estimate is None
    assert told == ["pose is silent"]
