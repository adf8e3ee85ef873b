"""Flights beside walls on what a laboratory gives, and on what it gives when it fails."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault, sentence
from fsw.autopilot.measurements import (
    GnssSample,
    ImuSample,
    JointSample,
    PoseSample,
    Sample,
    Sensor,
)
from sitl.scenario import Hold
from sitl.scenario_file import load_scenario
from sitl.simulation import START_US
from tests.closed_loop.harness import Flight

Spoil = Callable[[tuple[Sample, ...]], tuple[Sample, ...]]
AT = START_US * 1e-6


def changed(kind: type, first: float, last: float, change: Callable[[Any], Sample | None]) -> Spoil:
    """Change samples of a kind that are measured in an interval [s] of the flight; None: lost."""

    def spoil(samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
        out = []
        for sample in samples:
            within = type(sample) is kind and first <= sample.time - AT < last
            kept = change(sample) if within else sample
            if kept is not None:
                out.append(kept)
        return tuple(out)

    return spoil


def frozen() -> Callable[[Any], Any]:
    """All readings are the first one; time goes on."""
    held: list[Any] = []

    def freeze(sample: Any) -> Any:
        held.append(sample)
        return replace(held[0], time=sample.time)

    return freeze


def flown(seconds: float, spoil: Spoil, seed: int = 11) -> Flight:
    """A flight of `walls` with motion capture."""
    flight = Flight(load_scenario("walls", "mocap"), seed=seed, spoil_samples=spoil)
    flight.follow()
    flight.run(seconds)
    return flight


def error(flight: Flight) -> float:
    """Distance from the estimate to the truth [m]."""
    estimate = flight.state.estimate
    assert estimate is not None
    # The estimate is of the tick before the plant's last step.
    return math.dist(estimate.p_WB, flight.sim.truth().p_WB)


ONE_FRAME: list[tuple[str, type, Callable[[Any], Any], Sensor, SensorFault]] = [
    (
        "a place 1e6 m away",
        PoseSample,
        lambda s: replace(s, position=(1e6, 0.0, 0.0)),
        Sensor.POSE,
        SensorFault.IMPLAUSIBLE,
    ),
    (
        "a time 10 s ahead",
        PoseSample,
        lambda s: replace(s, time=s.time + 10.0),
        Sensor.POSE,
        SensorFault.FUTURE,
    ),
    (
        "upside down",
        PoseSample,
        lambda s: replace(s, attitude=(0.0, 1.0, 0.0, 0.0)),
        Sensor.POSE,
        SensorFault.JUMP,
    ),
    (
        "a rate that is not a number",
        ImuSample,
        lambda s: replace(s, rate=(math.nan, 0.0, 0.0)),
        Sensor.IMU,
        SensorFault.NOT_FINITE,
    ),
    (
        "a joint that is not a number",
        JointSample,
        lambda s: replace(s, angles=(math.nan, 0.0)),
        Sensor.ENCODERS,
        SensorFault.IMPLAUSIBLE,
    ),
]


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize(
    ("kind", "change", "sensor", "fault"),
    [row[1:] for row in ONE_FRAME],
    ids=[row[0] for row in ONE_FRAME],
)
def test_one_bad_frame_is_named_and_flown_through(
    kind: type, change: Callable[[Any], Any], sensor: Sensor, fault: SensorFault
) -> None:
    period = 1.0 / 120.0 if kind is PoseSample else 0.002
    flight = flown(0.8, changed(kind, 0.6, 0.6 + period, change))
    assert sentence(sensor, fault) in flight.texts
    assert error(flight) < 5e-3


FAILURES: list[tuple[str, Spoil, Sensor, SensorFault, float]] = [
    (
        "pose frozen for 0.3 s",
        changed(PoseSample, 21.0, 21.3, frozen()),
        Sensor.POSE,
        SensorFault.STUCK,
        0.01,
    ),
    (
        "pose lost for 2 s",
        changed(PoseSample, 21.0, 23.0, lambda s: None),
        Sensor.POSE,
        SensorFault.STALE,
        0.15,
    ),
    (
        "IMU frozen for 2 s",
        changed(ImuSample, 21.0, 23.0, frozen()),
        Sensor.IMU,
        SensorFault.STUCK,
        0.02,
    ),
    (
        "joint encoders frozen for 2 s",
        changed(JointSample, 21.0, 23.0, frozen()),
        Sensor.ENCODERS,
        SensorFault.STUCK,
        0.15,
    ),
]


@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.long
@pytest.mark.parametrize(
    ("spoil", "sensor", "fault", "off"),
    [row[1:] for row in FAILURES],
    ids=[row[0] for row in FAILURES],
)
def test_a_sensor_that_fails_beside_walls_is_named_and_touches_nothing(
    spoil: Spoil, sensor: Sensor, fault: SensorFault, off: float
) -> None:
    flight = Flight(load_scenario("walls", "mocap"), spoil_samples=spoil)
    flight.follow()
    flight.run(20.5)
    worst = 0.0
    for _ in range(20):
        flight.run(0.25)
        worst = max(worst, error(flight))
    assert any(sentence(sensor, fault) in text for text in flight.texts)
    assert worst < off
    assert min(flight.sim.result().surfaces_m.values()) > 0.0
    assert error(flight) < 0.02


@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.long
def test_encoders_that_freeze_are_named_and_no_joint_is_said_to_have_failed() -> None:
    """A joint that is not seen to move looks like one whose drive is dead; see ``DamageWatch``."""
    spoil = changed(JointSample, 12.0, 14.0, frozen())
    flight = Flight(load_scenario("walls", "mocap"), seed=1008, spoil_samples=spoil)
    flight.follow()
    flight.run(13.0)
    stuck = sentence(Sensor.ENCODERS, SensorFault.STUCK)
    assert [text for text in flight.texts if "sensor lost" in text and stuck in text]
    flight.run(3.0)
    assert not [text for text in flight.texts if "failed" in text]
    assert flight.sim.result().min_margin_m > 0.0


@pytest.mark.long
def test_odometry_that_drifts_says_how_far_and_keeps_as_much_farther_from_walls() -> None:
    flight = Flight(load_scenario("walls", "vio"), seed=900)
    flight.follow()
    worst, uncertain = 0.0, 0.0
    for _ in range(80):
        flight.run(0.5)
        estimate, known = flight.state.estimate, flight.state.estimator
        assert estimate is not None
        assert known is not None
        truth = flight.sim.truth().p_WB
        sigma = [math.sqrt(known.pose_covariance[k]) for k in (0, 6)]
        off = [abs(estimate.p_WB[k] - truth[k]) / sigma[k] for k in (0, 1)]
        worst, uncertain = max(worst, *off), max(uncertain, *sigma)
    assert uncertain > 0.02  # m
    assert worst < 3.5
    assert flight.sim.result().min_margin_m > 0.03


def test_five_positions_a_second_are_not_taken_for_a_loss() -> None:
    hold = Hold((0.0, 0.0, -3.6))
    flight = Flight(replace(load_scenario("field", "gnss"), walls=(), trajectory=hold), seed=900)
    flight.follow()
    flight.run(1.5)
    assert not [text for text in flight.texts if "no position" in text]


@pytest.mark.requirement("REQ-EST-1")
def test_a_receiver_that_loses_its_fix_is_said_to_have_none() -> None:
    """It goes on to speak: it is not silent."""
    hold = Hold((0.0, 0.0, -3.6))
    lost = changed(GnssSample, 1.0, 9.0, lambda one: replace(one, fix_type=1, satellites=3))
    scenario = replace(load_scenario("field", "rtk"), walls=(), trajectory=hold)
    flight = Flight(scenario, seed=900, spoil_samples=lost)
    flight.follow()
    flight.run(2.2)
    assert flight.texts.count(sentence(Sensor.GNSS, SensorFault.NO_FIX)) == 1
    assert not [text for text in flight.texts if "silent" in text]
    assert [text for text in flight.texts if "no position measurement: GNSS no fix" in text]
    report = flight.snapshot.estimator
    assert report is not None
    assert report.fix is not None
    assert (report.fix.kind, report.fix.satellites) == (1, 3)
