"""Sensors that lie, freeze or fall silent in flight; exact states that are no numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.measurements import ImuSample, JointSample, PoseSample, Sample
from fsw.autopilot.signals import Mode, SensorFrame
from sitl.scenario_file import load_scenario, parse_scenario
from sitl.simulation import STEP_US
from tests.closed_loop.harness import BESIDE_A_WALL, Flight
from tests.closed_loop.test_real_sensors import Spoil, changed, frozen

START_US = 1_000_000
FIRST = 300  # step of the fault
NAN = math.nan
NOTHING = (NAN, NAN, NAN)


def lies(steps: int, first: int = FIRST, **changes: Any) -> Callable[[SensorFrame], SensorFrame]:
    """Readings as given, for a number of steps."""

    def spoil(frame: SensorFrame) -> SensorFrame:
        step = (frame.t_us - START_US) // STEP_US
        return replace(frame, **changes) if first <= step < first + steps else frame

    return spoil


def told(flight: Flight, *words: str) -> bool:
    return any(all(word in text for word in words) for text in flight.texts)


def off(flight: Flight) -> float:
    """Distance of the estimate from the truth."""
    return math.dist(flight.snapshot.estimate.p_WB, flight.sim.truth().p_WB)


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (lies(5, p_WB=NOTHING), "pose implausible"),
        (lies(30, p_WB=NOTHING), "pose implausible"),
        (lies(1, v_WB=(1e6, 0.0, 0.0)), "pose implausible"),
        (lies(1, v_WB=(0.0, 1e30, 0.0)), "pose implausible"),
        (lies(25, p_WB=NOTHING, gyro_B=NOTHING, qd_arm=(NAN, NAN)), "IMU implausible"),
    ],
    ids=["10 ms", "no place", "1e6 m/s", "1e30 m/s", "nothing"],
)
def test_what_lasts_a_moment_is_flown_through_and_reported(
    spoil: Callable[[SensorFrame], SensorFrame], text: str
) -> None:
    flight = Flight(load_scenario("workspace"), spoil=spoil)
    flight.follow()
    while flight.sim.step < FIRST + 150:
        flight.step()
        assert flight.mode is Mode.TRAJECTORY
        assert 10.0 < sum(flight.outputs.actuators.rotor_thrust) < 60.0
        assert off(flight) < 0.02
    assert not told(flight, "safe set by")
    assert told(flight, text), flight.texts


@pytest.mark.requirement("REQ-ARM-1")
def test_telemetry_goes_on_without_an_estimate_and_says_so() -> None:
    flight = Flight(load_scenario("workspace"), spoil=lies(10**6, first=20, p_WB=NOTHING))
    for _ in range(60):
        flight.step()
    assert flight.mode is Mode.DISARMED
    snapshot = flight.snapshot
    assert snapshot.t_us == START_US + 59 * STEP_US, "every stream goes by it"
    assert snapshot.failures == (Condition.ESTIMATE_INVALID.value,)
    assert snapshot.estimate.t_us == snapshot.t_us


@pytest.mark.parametrize(
    ("kind", "name"), [(ImuSample, "IMU"), (JointSample, "joint encoders")], ids=["IMU", "joints"]
)
def test_telemetry_knows_which_sensor_is_lost(kind: type, name: str) -> None:
    flight = Flight(
        load_scenario("walls", "mocap"), spoil_samples=changed(kind, 0.5, 2.0, lambda _: None)
    )
    flight.follow()
    flight.run(0.4)
    assert flight.snapshot.sensors_lost == ()
    flight.run(0.4)
    assert flight.snapshot.sensors_lost == (name,)


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-3")
def test_how_sure_the_estimate_is_is_not_judged_while_no_position_is_measured() -> None:
    """By what it was after half a minute without, no push would be told for the whole flight."""
    lost = changed(PoseSample, 2.0, 36.0, lambda _: None)
    flight = Flight(parse_scenario(BESIDE_A_WALL, "standing", "mocap"), spoil_samples=lost)
    flight.run(36.0)
    assert flight.state.accuracy.reach == 0.0
    flight.run(9.0)
    assert flight.state.accuracy.told
    assert 0.0 < flight.state.accuracy.reach < 0.1


BESIDE = 4000  # at 8 s, on the way along the walls
LONG = 1000  # steps, 2 s


def without(kind: type) -> Spoil:
    """A sensor is silent for two seconds."""
    return changed(kind, 8.0, 10.0, lambda _: None)


def stuck(kind: type) -> Spoil:
    """A sensor says the same for two seconds, while time goes on."""
    return changed(kind, 8.0, 10.0, frozen())


def stuck_encoder(joint: int) -> Spoil:
    """The encoder of one joint says the same for two seconds."""
    held: list[float] = []

    def spoil(sample: Sample) -> Sample:
        assert isinstance(sample, JointSample)
        held.append(sample.angles[joint])
        angles = [held[0] if k == joint else angle for k, angle in enumerate(sample.angles)]
        return replace(sample, angles=(angles[0], angles[1]))

    return changed(JointSample, 8.0, 10.0, spoil)


def beside_walls(flight: Flight) -> None:
    """Fly for 3.5 s from the fault on; the plant ends the run at a contact."""
    flight.follow()
    while flight.sim.step < BESIDE + LONG + 750:
        flight.step()
        assert flight.sim.ended is None, (flight.sim.ended, flight.texts)
    assert flight.mode in (Mode.TRAJECTORY, Mode.HOLD)
    assert min(flight.sim.truth().margins_m) > 0.0
    assert off(flight) < 0.005, "all is known again"


@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.long
@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (without(PoseSample), ("no position measurement", "pose silent", "for 0.")),
        (stuck(PoseSample), ("no position measurement", "pose stuck")),
        (stuck(ImuSample), ("sensor lost: IMU stuck", "for 0.")),
        (without(ImuSample), ("sensor lost: IMU silent",)),
        (stuck(JointSample), ("sensor lost: joint encoders stuck", "for 0.")),
        (without(JointSample), ("sensor lost: joint encoders silent",)),
    ],
    ids=["no pose", "pose stuck", "IMU stuck", "no IMU", "encoders stuck", "no encoders"],
)
def test_two_seconds_without_a_sensor_beside_walls_touch_nothing(
    spoil: Spoil, words: tuple[str, ...]
) -> None:
    flight = Flight(load_scenario("walls", "mocap"), spoil_samples=spoil)
    beside_walls(flight)
    assert told(flight, *words), flight.texts


@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.long
@pytest.mark.parametrize("joint", [0, 1])
def test_one_encoder_that_is_stuck_beside_walls_is_told_and_touches_nothing(joint: int) -> None:
    flight = Flight(load_scenario("walls", "mocap"), spoil_samples=stuck_encoder(joint))
    flight.follow()
    while flight.sim.step < BESIDE + LONG + 750:
        flight.step()
        assert flight.sim.ended is None, (flight.sim.ended, flight.texts)
    assert told(flight, "sensor lost: joint encoders stuck"), flight.texts
    assert flight.mode is Mode.HOLD
    assert min(flight.sim.truth().margins_m) > 0.0


@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.long
@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lies(LONG, BESIDE, p_WB=NOTHING), ("no position measurement", "pose", "for 0.25 s")),
        (lies(LONG, BESIDE, gyro_B=NOTHING), ("sensor lost: IMU implausible", "for 0.05")),
        (lies(LONG, BESIDE, q_arm=(NAN, NAN)), ("sensor lost: joint encoders implausible",)),
    ],
    ids=["no pose", "no IMU", "no encoders"],
)
def test_exact_states_that_fail_for_two_seconds_touch_nothing(
    spoil: Callable[[SensorFrame], SensorFrame], words: tuple[str, ...]
) -> None:
    flight = Flight(load_scenario("walls"), spoil=spoil)
    beside_walls(flight)
    assert told(flight, *words), flight.texts
    assert not told(flight, "safe set by")
