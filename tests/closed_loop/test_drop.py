"""A payload that falls beside a wall: told to, as in the scenario ``drop``, or not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.parameters.flight_config import flight_config
from sitl.result import EndKind
from sitl.scenario import Scenario, vehicle_of
from sitl.scenario_file import load_scenario
from sitl.simulation import Simulation
from studies.flight.closed_loop import ScenarioFlight

WEIGHED_AGAIN_S = 0.2


def flown(scenario: Scenario, seed: int) -> tuple[ScenarioFlight, list[float]]:
    """The flight to its end, and the mass that the vehicle believed in after each step [kg]."""
    config = flight_config(body=scenario.body, vehicle=vehicle_of(scenario))
    flight, believed = ScenarioFlight(Simulation(scenario, seed), config), list[float]()
    while flight.loop.simulation.ended is None:
        flight.step()
        state: FlightState = flight.loop.state
        believed.append(state.record.payload.mass)
    return flight, believed


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-15")
@pytest.mark.parametrize(("suite", "seed"), [(None, 2), ("mocap", 3), ("mocap", 4)])
def test_a_payload_is_dropped_beside_a_wall(suite: str | None, seed: int) -> None:
    flight, believed = flown(load_scenario("drop", suite), seed)
    truth = flight.result().truth
    assert truth.completed, truth.end_reason
    assert truth.payload is not None
    assert truth.payload.released_m is not None
    assert truth.payload.released_m[0] > 0.8  # beside the wall
    assert 0.285 < believed[5000] < 0.315
    assert believed[5510] == 0.0


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-15")
@pytest.mark.parametrize(("suite", "seed"), [(None, 2), ("mocap", 2), ("mocap", 3)])
def test_a_payload_that_is_lost_is_missed_at_once(suite: str | None, seed: int) -> None:
    """For as long as it is believed to be there the joints' loops are several times too hard."""
    scenario = load_scenario("drop", suite)
    assert scenario.payload is not None
    falls = replace(scenario.payload, gripper=False, attach_at_s=3.0, release_at_s=11.0)
    pilot = replace(scenario.pilot, release_s=float("inf"))
    flight, believed = flown(replace(scenario, payload=falls, pilot=pilot), seed)
    simulation = flight.loop.simulation
    assert simulation.ended is not None
    assert simulation.ended.kind is EndKind.DURATION
    assert believed[round(500 * (11.0 + WEIGHED_AGAIN_S))] < 0.03
    truth = flight.result().truth
    assert truth.min_margin_m is not None
    assert truth.min_margin_m > 0.0
    assert flight.recorder.modes == [], flight.recorder.texts
    assert not any("noisier" in text for _, text in flight.recorder.texts)
