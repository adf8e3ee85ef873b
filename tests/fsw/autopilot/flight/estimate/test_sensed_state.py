"""The estimate from sensors with times of their own, as the tick makes it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fsw.autopilot.estimation.error_state import LOST, RATE, TIME
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.flight.state import first_state
from fsw.autopilot.measurements import GnssSample, ImuSample, JointSample, PoseSample, Sensor
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.signals import FlightSnapshot
from fsw.link.wire.encode_health import estimator_status
from messages.frames import wire_fields
from tests.fsw.autopilot.estimation.sensor_runs import MOCAP, RTK, TICK, run
from tests.fsw.autopilot.flight.test_autopilot import tick
from tests.fsw.link.snapshots import CONTEXT


def test_a_first_stamp_ahead_of_all_others_leaves_no_sensor_unused() -> None:
    """The link forgets it; the filter, whose newest readings are of that time, starts anew."""
    state, flown = first_state(AIRFRAME), run(MOCAP, 1, 0.3)
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


@pytest.mark.parametrize("every", [8, 16, 50])
def test_a_unit_that_is_slow_is_used_whenever_it_says_something(every: int) -> None:
    """Of one at 32 Hz no reading was, and a vehicle with satellites fell from 1.5 m."""
    state, read, flown = first_state(AIRFRAME), 0, run(MOCAP, 1, 1.2)
    for k, (now, samples) in enumerate(flown):
        heard = [one for one in samples if k < 300 or k % every == 0 or type(one) is not ImuSample]
        state, _ = tick(state, round(1e6 * now), samples=tuple(heard))
        units = [one for one in heard if type(one) is ImuSample]
        if k < 300 + every or not units:
            continue
        assert state.fusion is not None
        rows = state.fusion.numbers["imu"][0]
        (row,) = rows[rows[:, TIME] == units[0].time]
        assert row[RATE : RATE + 3].tolist() == list(units[0].rate)
        assert not row[LOST]
        read += 1
    assert read > 300 // every - 3


@pytest.mark.parametrize("back", [0.0034, 0.017, 0.05])
def test_a_clock_that_is_set_back_by_little_loses_nothing_of_what_was_known(back: float) -> None:
    """With the poses gone there would be nothing to start anew from."""
    state, flown = first_state(AIRFRAME), run(MOCAP, 1, 1.2)
    for k, (now, samples) in enumerate(flown):
        if k >= 300:
            now -= back
            samples = [
                replace(one, time=one.time - back)
                for one in samples
                if not isinstance(one, PoseSample)
            ]
        state, _ = tick(state, round(1e6 * now), samples=tuple(samples))
        assert k < 20 or state.estimate is not None
    assert state.fusion is not None
    assert state.fusion.started
    assert state.fusion.restarts == 0
    assert state.estimate is not None
    k = flown.truth.at(now + back)
    assert state.estimate.p_WB == pytest.approx(flown.truth.p[k], abs=0.1)


def test_before_the_first_estimate_looks_at_sensors_are_as_rare_as_after_it() -> None:
    """Without encoders there is none; the pose comes for a while, and then no more."""
    state, told = first_state(AIRFRAME), []
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
    of_sensors = [text for text in told if "estimate invalid" not in text]
    assert of_sensors == ["pose silent"]


def test_an_estimate_that_is_lost_is_reported_as_one() -> None:
    """The filter is no number, and there is no pose from which it could start anew."""
    state, outputs = first_state(AIRFRAME), None
    for k, (now, samples) in enumerate(run(MOCAP, 1, 1.2)):
        heard = [one for one in samples if k < 300 or not isinstance(one, PoseSample)]
        if k == 300:
            assert state.fusion is not None
            state.fusion.numbers["p"][:] = math.nan
        state, outputs = tick(state, round(1e6 * now), samples=tuple(heard))
        if k == 299:
            known = wire_values(outputs.snapshot)
            assert known["flags"] & 1
            assert 0.0 <= known["pos_horiz_ratio"] < 1.0
    assert outputs is not None
    lost = wire_values(outputs.snapshot)
    assert lost["flags"] == 0
    assert outputs.snapshot.t_us - lost["time_usec"] < 110_000
    ratios = [number for name, number in lost.items() if name not in ("flags", "time_usec")]
    assert len(ratios) == 8
    assert all(math.isnan(one) for one in ratios)
    assert outputs.snapshot.estimator is not None
    silent = {one.name: one.fault for one in outputs.snapshot.estimator.sensors}
    assert silent[Sensor.POSE.value] == "stale"


def wire_values(snapshot: FlightSnapshot) -> dict[str, Any]:
    """ESTIMATOR_STATUS by the names of its fields."""
    return dict(zip(wire_fields(230), estimator_status(snapshot, CONTEXT), strict=True))


def test_what_lasts_of_a_sensors_error_is_reported_and_no_reason_to_come_down() -> None:
    """Satellites whose errors wander by more than a metre: the filter is surer than any fix."""
    stated = (1.6, 1.7, 4.0)  # m^2
    state = first_state(AIRFRAME)
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


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("noise", [0.0, 0.006])
def test_poses_that_scatter_more_than_they_state_are_told(noise: float) -> None:
    state, random, told = first_state(AIRFRAME), np.random.default_rng(2), []
    for now, samples in run(MOCAP, 1, 2.5):
        spoilt = []
        for one in samples:
            if isinstance(one, PoseSample) and now > 6.5:
                x, y, z = one.position
                off = noise * random.standard_normal(3)
                one = replace(one, position=(x + off[0], y + off[1], z + off[2]))
            spoilt.append(one)
        state, outputs = tick(state, round(1e6 * now), samples=tuple(spoilt))
        told += [one.text for one in outputs.texts]
    assert ("pose noisier than stated" in told) is (noise > 0.0)
    assert told.count("pose noisier than stated") <= 1


@pytest.mark.requirement("REQ-EST-4")
def test_how_far_away_refused_poses_say_it_is_is_known_until_one_is_used() -> None:
    state, farthest, last = first_state(AIRFRAME), 0.0, math.nan
    for now, samples in run(MOCAP, 1, 2.0):
        moved = 6.0 < now < 6.5
        told = tuple(
            replace(one, position=(one.position[0], one.position[1] + 3.0, one.position[2]))
            if moved and isinstance(one, PoseSample)
            else one
            for one in samples
        )
        state, _ = tick(state, round(1e6 * now), samples=told)
        last = state.aiding.elsewhere
        assert last == 0.0 or moved or now < 6.7
        farthest = max(farthest, last)
    assert farthest == pytest.approx(3.0, abs=0.1)
    assert last == 0.0
