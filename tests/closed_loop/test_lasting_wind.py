"""A push that lasts is cancelled, and clearances have grown by what it can do when it turns."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.signals import Mode
from sitl.disturbances.sequence import Played
from sitl.scenario import Wind
from sitl.scenario_file import parse_scenario
from sitl.simulation import STEP_US
from studies.fault_matrix.flights import beside_the_wall_text
from tests.closed_loop.harness import ARM, BESIDE_A_WALL, SET_MODE, Flight, command

PUSH = 0.5  # m/s^2, north, where the wall is
WORST = PUSH + 0.8  # m/s^2, what lasts and the disturbance of the safety manual on top


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-2")
def test_clearances_grow_with_the_memory_of_wind_and_shrink_with_it() -> None:
    calm = parse_scenario(BESIDE_A_WALL.replace('"ground"', '"airborne"'), "wall", "perfect")
    pushed = replace(calm, disturbances=(Wind((PUSH, 0.0, 0.0)),))
    flight = Flight(pushed)
    flight.step(command(ARM, 1.0))
    flight.run(1.0)
    assert max(flight.state.kept.added, default=0.0) <= 0.005
    flight.run(24.0)
    memory = flight.state.record.observed.disturbance_bias[0]
    assert memory == pytest.approx(0.45, abs=0.03), "it is taken for wind"
    (grown,) = flight.state.kept.added
    assert grown == pytest.approx(0.0823 * (memory - 0.05), abs=2.5e-3)
    (source,), (kept,) = flight.state.kept.source.zones, flight.state.kept.safe_set.zones
    assert kept.clearance == pytest.approx(source.clearance + grown)
    assert flight.state.kept.shortfall == pytest.approx(0.0, abs=1e-9)


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-2")
@pytest.mark.parametrize("land", [False, True])
@pytest.mark.parametrize(
    ("suite", "turns_s", "seed"), [("perfect", 1.65, 5), ("perfect", 3.0, 6), ("mocap", 3.0, 7)]
)
def test_wind_that_turns_at_once_with_all_it_has_breaks_no_clearance_and_no_sensor(
    suite: str, turns_s: float, seed: int, land: bool
) -> None:
    scenario = parse_scenario(beside_the_wall_text("airborne", "none"), "wall", suite)
    # Off the wall at first: the memory of it pushes as well once it turns.
    values = [(WORST * (-1.0) ** (k + 1), 0.0, 0.0) for k in range(8)]
    steps = round(1e6 * turns_s / STEP_US)
    flight = Flight(scenario, seed, pushes=(Played(values, round(0.9e6 / STEP_US), steps),))
    flight.step(command(ARM, 1.0))
    flight.run(1.0)
    if land:
        flight.step(command(SET_MODE, 1.0, 4.0, 6.0))
    flight.run(5.5 if land else 12.0)
    assert not [text for text in flight.texts if "failsafe" in text or "contradict" in text]
    assert flight.sim.ended is None
    assert flight.mode is (Mode.DISARMED if land else Mode.HOLD)
    assert (flight.sim.min_margin_m or 0.0) > 0.0
