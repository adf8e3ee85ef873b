"""Vehicles that nobody built, of rotors and joints as they come: each flies a hop."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode
from tests.closed_loop.harness import ARM, LAND, TAKEOFF, Flight, command, on_the_ground
from tests.vehicles.random_vehicles import multirotor_with_arm
from vehicles.vehicle_file import vehicle_text

COUNT = 30


@pytest.mark.drawn(1)
@pytest.mark.parametrize("number", range(COUNT))
def test_it_hops_within_its_limits(number: int, tmp_path: Path) -> None:
    vehicle = multirotor_with_arm(np.random.default_rng(5_000 + number))
    path = tmp_path / f"{vehicle.name}.toml"
    path.write_text(vehicle_text(vehicle), encoding="utf-8")
    config = flight_config(body="points", vehicle=vehicle)
    flight = Flight(replace(on_the_ground(), vehicle=str(path)), config=config)
    flight.run(0.2)
    stood = flight.sim.truth().p_WB
    flight.step(command(ARM, 1.0))
    flight.step(command(TAKEOFF))
    flight.run(6.0)
    assert flight.mode is Mode.HOLD, flight.texts
    places = []
    for _ in range(20):
        flight.run(0.2)
        places.append(flight.sim.truth().p_WB)
    spread = np.std(places, axis=0)
    assert spread.max() < 0.01, "it hovers"
    x, y, z = places[-1]
    assert math.isclose(stood[2] - z, config.limits.takeoff_climb, abs_tol=0.05)
    assert math.hypot(x - stood[0], y - stood[1]) < 0.15
    flight.step(command(LAND))
    flight.until(Mode.DISARMED, config.limits.takeoff_climb / config.limits.land_speed + 4.0)
    assert math.isclose(flight.sim.truth().p_WB[2], stood[2], abs_tol=0.02)
    assert flight.sim.ended is None
    beyond = [name for name, use in flight.sim.result().limits.items() if not use.kept]
    assert beyond == []
