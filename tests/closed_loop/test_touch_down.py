"""Rotors never stop in the air, and they do on the ground, whatever the vehicle believes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.flight.modes import MODES
from fsw.autopilot.measurements import ImuSample, Sample, Sensor, Vec3
from fsw.autopilot.signals import Mode, SensorFrame
from sitl.scenario import Pilot, Scenario
from sitl.scenario_file import load_scenario
from sitl.simulation import START_US
from tests.closed_loop.harness import ARM, LAND, SET_MODE, Flight, command, hover

ALMOST = 0.02  # m, of the lowest foot above the ground
# The same where readings are in doubt: what the legs feel there would be taken for a climb.
CLOSE = 0.13
LEGS = 0.32  # m, below the base


def with_suite(suite: str) -> Scenario:
    if suite == "perfect":
        return hover()
    return replace(hover(), sensors=load_scenario("walls", suite).sensors)


def lowest_foot(flight: Flight) -> float:
    """Height of the lowest foot [m]."""
    truth = flight.sim.truth()
    w, x, y, z = truth.q_WB
    down = (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    return -truth.p_WB[2] - 0.2 * (abs(down[0]) + abs(down[1])) - LEGS * down[2]


def check_stop(suite: str, seed: int, wrong: Vec3, from_s: float) -> None:
    """Land with a wrong accelerometer: rotors stop on the ground, or not within 20 s."""
    flight = Flight(with_suite(suite), seed)

    def spoil(samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
        if flight.sim.time_s < from_s:
            return samples
        return tuple(
            replace(one, acceleration=tuple(np.add(one.acceleration, wrong).tolist()))
            if isinstance(one, ImuSample)
            else one
            for one in samples
        )

    flight.spoil_samples = spoil
    flight.step(command(ARM, 1.0))
    while flight.sim.ended is None and flight.sim.time_s < 20.0:
        aiding = flight.state.aiding
        flight.step(*((command(LAND),) if flight.sim.step == 500 else ()))
        if flight.mode is Mode.DISARMED:
            in_doubt = aiding.disputed_us > 0 or aiding.has_lost(Sensor.IMU)
            assert lowest_foot(flight) < (CLOSE if in_doubt else ALMOST)
            return
        assert flight.mode in MODES or flight.mode is Mode.FAULT


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-MODE-9")
@pytest.mark.parametrize(
    ("suite", "seed", "wrong", "from_s"),
    [
        ("rtk", 834, (-1.71, 0.84, 1.83), 4.4),  # disarmed 0.28 m up, and fell
        ("vio", 413, (-1.36, -2.96, 0.87), 3.5),  # 0.06 m up
        pytest.param("vio", 772, (-2.56, -1.45, 1.58), 3.4, marks=pytest.mark.long),
        pytest.param("rtk", 129, (-0.47, 0.99, -0.26), 3.1, marks=pytest.mark.long),
    ],
)
def test_a_wrong_accelerometer_never_stops_the_rotors_in_the_air(
    suite: str, seed: int, wrong: Vec3, from_s: float
) -> None:
    check_stop(suite, seed, wrong, from_s)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20, 32))
@pytest.mark.parametrize("suite", ["vio", "rtk"])
def test_nor_does_any_other(suite: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    x, y, z = random.uniform(-3.0, 3.0, 3).tolist()
    check_stop(suite, seed, (x, y, z), float(random.uniform(1.0, 5.0)))


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-MODE-9")
@pytest.mark.parametrize("mass", [0.8, 1.2])
@pytest.mark.parametrize("suite", ["perfect", "rtk"])
def test_a_landing_ends_within_a_second_of_the_ground(suite: str, mass: float) -> None:
    calm = with_suite(suite)
    calm = replace(calm, vehicle_scale=replace(calm.vehicle_scale, mass=mass))
    flight = Flight(calm, seed=7)
    flight.step(command(ARM, 1.0))
    flight.run(1.0)
    flight.step(command(LAND))
    touched_s = None
    while flight.mode is not Mode.DISARMED:
        flight.run(0.02)
        if touched_s is None and lowest_foot(flight) < 0.001:
            touched_s = flight.sim.time_s
        assert flight.sim.time_s < 12.0
    assert touched_s is not None
    assert flight.sim.time_s - touched_s < 1.0
    assert flight.sim.truth().q_WB[0] > 0.999, "upright"
    assert not any("no plan" in text for text in flight.texts)


@pytest.mark.long
@pytest.mark.requirement("REQ-MODE-13")
@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.TRAJECTORY])
def test_a_vehicle_that_sinks_to_the_ground_and_believes_to_fly_stops_its_rotors(
    mode: Mode,
) -> None:
    """Its height runs away; on the ground it would press on, and turn over as gyros drift."""
    flight = Flight(replace(hover(), pilot=Pilot("trajectory")), spoil=rising)
    flight.step(command(ARM, 1.0))
    if mode is Mode.TRAJECTORY:
        flight.step(command(SET_MODE, 1.0, 4.0, 11.0))
    assert flight.mode is mode
    flight.run(3.0)
    assert lowest_foot(flight) > 0.2
    flight.run(7.0)
    assert flight.mode is Mode.DISARMED
    assert lowest_foot(flight) < ALMOST
    assert [text for text in flight.texts if "ground contact: rotors carry less" in text]
    assert flight.texts[-1] == "land to disarmed: touched down"


def rising(frame: SensorFrame) -> SensorFrame:
    """The height that it is told is that of a climb at 0.3 m/s."""
    x, y, z = frame.p_WB
    return replace(frame, p_WB=(x, y, z - 0.3e-6 * (frame.t_us - START_US)))
