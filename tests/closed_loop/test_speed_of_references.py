"""A reference that is far away leads no vehicle faster than ``STR_V_MAX``, in whichever mode."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.signals import Mode
from fsw.frozen import replace
from tests.closed_loop.harness import LAND, Flight, command, hover

# m/s over the largest speed: what the loops overshoot a reference that runs at it.
OVERSHOOT = 0.15


@pytest.mark.requirement("REQ-SAFE-7")
def test_a_landing_that_was_driven_off_its_place_returns_no_faster_than_allowed() -> None:
    flight = Flight(hover())
    flight.step(command(400, 1.0))
    flight.run(1.0)
    flight.step(command(LAND))
    flight.run(0.5)
    assert flight.mode is Mode.LAND
    x, y, z = flight.state.vehicle.mode_origin
    moved = replace(flight.state.vehicle, mode_origin=(x + 4.0, y + 3.0, z))
    flight.state = replace(flight.state, vehicle=moved)
    fastest = 0.0
    for _ in range(800):
        flight.step()
        fastest = max(fastest, math.hypot(*flight.sim.truth().v_WB))
    assert 0.5 < fastest < flight.config.steering.speed + OVERSHOOT
    assert math.hypot(*flight.sim.truth().p_WB[:2]) > 0.5, "it is on its way"
