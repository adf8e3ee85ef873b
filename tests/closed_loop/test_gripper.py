"""A payload that the gripper takes up in flight, and lets go of beside a wall."""

from __future__ import annotations

import pytest

from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode
from fsw.frozen import replace
from sitl.scenario import Payload, ScenarioWall, Uniform, vehicle_of
from tests.closed_loop.harness import ARM, Flight, command, hover

DO_GRIPPER, GRAB, RELEASE, HOLD = 211, 1.0, 0.0, 2.0
KG = 0.1
WALL = ScenarioWall("wall", (-1.0, 0.0, 0.0), -0.7, 0.1)


def gripping(vehicle: str, seed: int = 3) -> Flight:
    """Hovering disturbed beside a wall, with a payload within reach."""
    payload = Payload(mass_kg=KG, inertia_kg_m2=(1e-4, 1e-4, 1e-4), gripper=True)
    scenario = replace(
        hover(), vehicle=vehicle, body="full", payload=payload, walls=(WALL,),
        disturbances=(Uniform(0.8, 0.1),),
    )  # fmt: skip
    flight = Flight(scenario, seed, config=flight_config(body="full", vehicle=vehicle_of(scenario)))
    flight.step(command(ARM, 1.0))
    flight.run(1.0)
    return flight


@pytest.mark.parametrize("vehicle", ["paper", "x500-2r"])
def test_what_is_gripped_is_carried_weighed_and_dropped_beside_a_wall(vehicle: str) -> None:
    flight = gripping(vehicle)
    empty = flight.state.cascade.mass
    flight.step(command(DO_GRIPPER, 1.0, GRAB))
    flight.step(command(DO_GRIPPER, 1.0, HOLD))
    flight.run(3.0)
    assert flight.sim.payload.held_kg == KG
    whole = flight.sim.vehicle.mass + KG
    assert flight.state.cascade.mass == pytest.approx(whole, rel=0.05)
    assert flight.state.cascade.mass > empty
    flight.step(command(DO_GRIPPER, 1.0, RELEASE))
    flight.run(2.0)
    assert flight.sim.payload.held_kg == 0.0
    assert [result for _, result in flight.results] == [0, 0, 0, 0]
    assert flight.mode is Mode.HOLD, flight.texts
    assert flight.snapshot.safety.breaches == 0


def test_a_gripper_knows_three_wishes() -> None:
    flight = gripping("paper")
    flight.step(command(DO_GRIPPER, 1.0, 7.0))
    assert flight.results[-1][1] != 0
    assert "gripper not moved: param2 = 7; 0 releases, 1 grabs, 2 holds" in flight.texts
    assert flight.state.vehicle.gripper == 0.0
