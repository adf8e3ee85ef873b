"""The suites by name: their numbers, single keys in place of them, and streams of their own."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from sitl.scenario import Hold, Pilot, Scenario, Start
from sitl.scenario_file import SUITE_NAMES, ScenarioError, load_scenario, parse_scenario
from sitl.sensors.channel import Measurement
from sitl.sensors.encoders import JointMeasurement
from sitl.sensors.imu import ImuMeasurement
from sitl.sensors.keys import Magnetometer, MeasuredSensors
from sitl.sensors.motion_capture import PoseMeasurement
from sitl.sensors.suite import SensorSuite
from sitl.simulation import Controls, Simulation
from tests.sitl.sensors.readings import HOVER, START_US, STEP_US, reading
from tests.sitl.vehicles import PAPER

HEAD = """
duration_s = 10.0
[start]
kind = "airborne"
[pilot]
plan = "none"
[trajectory]
kind = "hold"
position_m = [0.0, 0.0, -1.2]
"""


def sensors(text: str, suite: str | None = None) -> MeasuredSensors:
    """The suite of a scenario with this text about sensors."""
    found = parse_scenario(HEAD + text, "test", suite).sensors
    assert isinstance(found, MeasuredSensors)
    return found


def arrivals(suite: MeasuredSensors, steps: int, seed: int = 3) -> list[Measurement]:
    """Everything that a suite says of a vehicle that moves evenly."""
    fitted = SensorSuite(suite, seed, START_US, vehicle=PAPER, hover_thrust=8.0)
    return [
        one for k in range(steps) for one in fitted.step(reading(START_US + STEP_US * k), HOVER)
    ]


@pytest.mark.parametrize("name", [name for name in SUITE_NAMES if name != "perfect"])
def test_every_suite_can_be_read_and_says_what_it_has_at_its_rates(name: str) -> None:
    suite = sensors(f'[sensors]\nsuite = "{name}"')
    assert suite.suite == name
    counts = Counter(type(one).__name__ for one in arrivals(suite, 2500))
    rates = {
        "ImuMeasurement": suite.imu, "JointMeasurement": suite.encoders,
        "PoseMeasurement": suite.motion_capture or suite.visual_odometry,
        "GnssMeasurement": suite.gnss, "PressureMeasurement": suite.barometer,
        "MagneticMeasurement": suite.magnetometer, "RangeMeasurement": suite.rangefinder,
    }  # fmt: skip
    for kind, keys in rates.items():
        expected = 0.0 if keys is None else 5.0 * keys.rate_hz
        assert counts[kind] == pytest.approx(expected, rel=0.1, abs=3.0), kind


def test_the_suite_of_the_laboratory_is_the_issues() -> None:
    capture = sensors('[sensors]\nsuite = "mocap"').motion_capture
    assert capture is not None
    assert (capture.rate_hz, capture.latency_ms) == (120.0, 15.0)
    assert (capture.position_m, capture.attitude_deg) == (0.0005, 0.2)
    assert (capture.dropout_share, capture.outlier_share) == (0.01, 0.002)
    assert (capture.gap_ms, capture.gap_every_s) == (200.0, 60.0)


def test_single_keys_stand_in_place_of_the_suites() -> None:
    text = '[sensors]\nsuite = "mocap"\n[sensors.motion_capture]\nlatency_ms = 30.0'
    changed, usual = sensors(text), sensors('[sensors]\nsuite = "mocap"')
    assert changed.motion_capture is not None
    assert usual.motion_capture is not None
    assert changed.motion_capture == replace(usual.motion_capture, latency_ms=30.0)
    assert changed.imu == usual.imu


def test_the_command_lines_suite_takes_the_scenarios_keys_only_if_it_is_the_same() -> None:
    text = '[sensors]\nsuite = "mocap"\n[sensors.motion_capture]\nlatency_ms = 30.0'
    same = sensors(text, "mocap").motion_capture
    assert same is not None
    assert same.latency_ms == 30.0
    assert sensors(text, "vio") == sensors('[sensors]\nsuite = "vio"')
    exact = parse_scenario(HEAD + text, "test", "perfect")
    assert exact.sensors == parse_scenario(HEAD, "test").sensors


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[sensors]\nsuite = "mocapp"', ["sensors.suite", '"mocapp"', '"mocap"']),
        ("[sensors]\nsuite = 3", ["sensors.suite", "must be a text"]),
        ('[sensors]\nsuite = "mocap"\n[sensors.gnss]\nrate_hz = 5.0',
         ["sensors.gnss", '"mocap" has no such sensor', "motion_capture"]),
        ('[sensors]\nsuite = "mocap"\n[sensors.imu]\nrate_hz = 900.0',
         ["sensors.imu.rate_hz", "500"]),
        ('[sensors]\nsuite = "mocap"\nimu = 4', ["sensors.imu = 4", "must be a table"]),
        ('[sensors]\nsuite = "mocap"\n[sensors.imu]\nlatency = 3.0',
         ["sensors.imu.latency", '"latency_ms"']),
        ("sensors = 4", ["sensors = 4", "must be a table"]),
        ('[sensors]\nsuite = "rtk"\n[sensors.gnss]\nrtk = 1',
         ["sensors.gnss.rtk", "true or false"]),
    ],
)  # fmt: skip
def test_a_wrong_key_is_refused_with_what_is_allowed(text: str, words: list[str]) -> None:
    whole = text + "\n" + HEAD if text == "sensors = 4" else HEAD + text
    with pytest.raises(ScenarioError) as refused:
        parse_scenario(whole, "test")
    for word in words:
        assert word in str(refused.value)


def test_another_sensor_changes_nothing_of_what_the_others_say() -> None:
    suite = sensors('[sensors]\nsuite = "mocap"')
    compass = Magnetometer(rate_hz=50.0, field_gauss=(0.2, 0.0, 0.4), noise_gauss=0.01)
    alone, beside = arrivals(suite, 300), arrivals(replace(suite, magnetometer=compass), 300)
    kinds = (ImuMeasurement, JointMeasurement, PoseMeasurement)
    assert alone == [one for one in beside if isinstance(one, kinds)]
    assert len(beside) > len(alone)


def test_the_same_seed_gives_the_same_readings_and_another_seed_others() -> None:
    suite = sensors('[sensors]\nsuite = "rtk"')
    assert arrivals(suite, 300, 5) == arrivals(suite, 300, 5)
    assert arrivals(suite, 300, 5) != arrivals(suite, 300, 6)


def test_sensors_do_not_touch_the_flight() -> None:
    """The disturbance draws what it draws with any suite: the plant is the same to the bit."""
    states = []
    for suite in ("perfect", "mocap", "rtk"):
        simulation = Simulation(load_scenario("walls", suite), 4)
        for _ in range(100):
            simulation.measurements()
            simulation.advance(Controls((0.5, 0.5, 0.5, 0.5), (0.0, 0.0), armed=True))
        states.append(simulation.state_bytes())
    assert states[0] == states[1] == states[2]


def test_asking_twice_in_a_step_gives_the_same_and_perfect_has_no_measurements() -> None:
    simulation = Simulation(load_scenario("walls", "mocap"), 0)
    first = simulation.measurements()
    assert first
    assert simulation.measurements() is first
    assert Simulation(load_scenario("walls"), 0).measurements() is None


def test_a_standing_vehicle_feels_its_weight() -> None:
    start, pilot = Start(kind="ground"), Pilot(plan="none")
    suite = sensors('[sensors]\nsuite = "mocap"')
    flown = Scenario("test", 1.0, start, pilot, Hold((0.0, 0.0, -1.0)), sensors=suite)
    said = Simulation(flown, 0).measurements()
    assert said is not None
    imu = said[-1]
    assert isinstance(imu, ImuMeasurement)
    assert imu.accel_B == pytest.approx((0.0, 0.0, -9.81), abs=0.5)
