"""An inertial unit that is wrong in some way, drawn at random, beside a wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sitl.faults.keys import Fault
from sitl.scenario import Scenario
from sitl.scenario_file import parse_scenario
from sitl.simulation import STEP_US
from studies.fault_matrix.flights import beside_the_wall_text, fly
from tests.closed_loop.harness import ARM, Flight, command

SECONDS = 9.0  # from the fault on; a landing takes five
LOW = 0.42  # m: rotors do not explain what legs feel that are below 0.1 m

in_long = pytest.mark.long


def begun(scenario: Scenario, seed: int, seconds: float) -> Flight:
    """A flight to the fault; satellites alone are off by as much as it is high and from the wall.

    Where their first position is behind the wall, it is over before anything has failed, and is
    drawn again; so it is where the legs are so low that nobody is compared (docs/decisions/0041).
    """
    for draw in range(9 if scenario.sensors.suite == "gnss" else 1):
        flight = Flight(scenario, seed=seed + 100 * draw)
        flight.step(command(ARM, 1.0, 21196.0))
        while flight.sim.ended is None and flight.sim.step * STEP_US < 1e6 * seconds:
            flight.step()
        if flight.sim.ended is None and -flight.sim.truth().p_WB[2] > LOW:
            break
    assert flight.sim.ended is None, f"before the fault: {flight.sim.ended}"
    return flight


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("suite", ["mocap", "vio", "rtk", "gnss"])
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=in_long) for k in range(1, 20))])
def test_whatever_is_wrong_with_it_is_told_and_nothing_is_touched(suite: str, seed: int) -> None:
    random = np.random.default_rng((seed, len(suite)))
    fault = Fault(
        unit=random.choice(["gyro", "accel"]),
        kind=random.choice(["off", "stuck", "garbage", "wrong", "intermittent", "slow", "delayed"]),
        start_s=float(random.uniform(4.0, 6.0)),
        axis=float(random.integers(0, 4)),
        share=float(random.uniform(0.1, 0.95)),
        delay_ms=2.0 * float(random.integers(5, 250)),
        rate_hz=float(random.uniform(1.0, 50.0)),
        size=float(random.choice([-1.0, 1.0]) * random.uniform(1.0, 5.0)),
    )
    scenario = parse_scenario(beside_the_wall_text("airborne", "none"), "wall", suite)
    flight = begun(replace(scenario, faults=(fault,)), 1100 + seed, fault.start_s)
    said = len(flight.texts)
    flight.run(SECONDS)
    assert flight.sim.ended is None, f"{fault}: {flight.sim.ended}"
    assert len(flight.texts) > said, f"{fault} is told"


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("mode", "suite", "faults"),
    [
        ("land", "gnss", [Fault("mag", "drifting", start_s=0.5, size=1.8)]),
        ("hold", "gnss", [Fault("mag", "wrong", start_s=1.0, size=0.15)]),
        ("hold", "rtk", [Fault("accel", "drifting", start_s=0.3, size=1.2)]),
        ("trajectory", "rtk", [Fault("joint", "off", instance=1, start_s=3.0, duration_s=0.3)]),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_a_sound_gyro_is_not_tilted_by_what_it_is_suspected_for(
    mode: str, suite: str, faults: list[Fault], seed: int
) -> None:
    """Its bias was unknown by 0.5 rad/s, whatever had been seen, and pairs with these hit walls."""
    flight = fly(mode, tuple(faults), suite, 1700 + seed)
    assert flight.contact == "", flight.ended
    assert flight.away_m is not None
    assert flight.away_m < 5.0


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("mode", "suite", "faults", "seed"),
    [
        # A comparison that fired by chance excused the tilt of a pose that had jumped 4 s before.
        (
            "trajectory",
            "mocap",
            [Fault("vio", "wrong", size=2.0), Fault("encoder", "delayed", start_s=0.5)],
            0,
        ),
        # It held between walls, without a position, for two seconds longer than it had room for.
        (
            "trajectory",
            "mocap",
            [Fault("encoder", "delayed"), Fault("vio", "wrong", start_s=1.0, size=2.0)],
            1,
        ),
        # Doubts ended where the ground was felt, and the wrong force lifted the vehicle again.
        ("land", "gnss", [Fault("accel", "wrong")], 0),
    ],
)
def test_flights_that_hit_a_wall_once_do_not(
    mode: str, suite: str, faults: list[Fault], seed: int
) -> None:
    flight = fly(mode, tuple(faults), suite, seed)
    assert flight.contact == "", flight.ended


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("mode", "suite", "fault", "seed"),
    [
        ("hold", "vio", Fault("accel", "wrong", axis=3.0, size=1.135, start_s=0.26), 102),
        ("hold", "vio", Fault("accel", "wrong", axis=3.0, size=1.135, start_s=0.26), 103),
        ("hold", "vio", Fault("accel", "wrong", axis=3.0, size=-1.2, start_s=0.3), 202),
        ("land", "vio", Fault("accel", "wrong", axis=3.0, size=1.135, start_s=0.26), 104),
        ("hold", "rtk", Fault("accel", "drifting", axis=3.0, size=1.5, start_s=0.2), 52),
    ],
)
def test_an_accelerometer_that_is_wrong_along_z_is_not_borne_out_by_the_rotors(
    mode: str, suite: str, fault: Fault, seed: int
) -> None:
    """The mass followed it within a second, a sound pose was named, and vehicles flew away."""
    flight = fly(mode, (fault,), suite, seed)
    assert flight.contact == "", flight.ended
    assert flight.away_m is not None
    assert flight.away_m < 2.0
    assert not any("pose inconsistent" in said.text for said in flight.warnings)


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("size", "seed"), [(0.0, 30), (0.0, 31), (0.25, 6), (0.25, 18), (0.5, 7), (0.5, 32), (1.0, 33)]
)
def test_a_descent_without_a_height_goes_down_whatever_the_accelerometer_says(
    size: float, seed: int
) -> None:
    """It said that the vehicle sinks; that climbed for ever, 60 to 150 m in 17 s."""
    wrong = Fault("accel", "wrong", axis=3.0, size=size, start_s=0.3)
    lost = Fault("vio", "off", start_s=0.4)
    flight = fly("hold", (wrong, lost) if size else (lost,), "mocap", seed)
    assert flight.away_m is not None
    assert flight.away_m < 4.0, "carried off by a second or two of the wrong force"
    told = any("IMU inconsistent" in said.text for said in flight.warnings)
    assert told is (size > 0.0)


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("seed", [21, *(pytest.param(k, marks=in_long) for k in range(22, 26))])
def test_the_wind_that_a_wrong_accelerometer_makes_up_is_not_leaned_against(seed: int) -> None:
    """Without a place it went on getting faster, by 2 m/s^2, until it touched down 14 m away."""
    pose = Fault("vio", "wrong", start_s=2.57, size=-0.501)
    unit = Fault("accel", "wrong", start_s=4.18, size=2.38)
    flight = fly("orbit", (pose, unit), "vio", seed)
    assert "descend" in flight.actions
    assert flight.away_m is not None
    assert flight.away_m < 11.4, "2 m/s by then, and the rest by the wrong speed that it brakes"


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("mode", ["trajectory", "mission"])
@pytest.mark.parametrize("seed", [40, *(pytest.param(k, marks=in_long) for k in range(41, 50))])
def test_what_a_pose_teaches_that_freezes_for_a_moment_is_taken_back(mode: str, seed: int) -> None:
    """Biases of 0.8 rad/s were left, and the good poses after it were refused until a wall."""
    random = np.random.default_rng((seed, len(mode)))
    lasts = float(random.uniform(0.25, 0.6))
    flight = fly(mode, (Fault("vio", "frozen", duration_s=lasts),), "mocap", seed)
    assert flight.contact == "", flight.ended
    assert flight.least_m is not None
    assert flight.least_m > 0.0
    assert any("pose" in said.text for said in flight.warnings)
