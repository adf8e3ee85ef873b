"""A vehicle that is lighter or heavier than believed; lighter, the tracking loop once diverged."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import Flight


@pytest.mark.long
@pytest.mark.parametrize("scale", [0.8, 1.2])
def test_the_sphere_is_kept_with_another_mass(scale: float) -> None:
    workspace = load_scenario("workspace")
    flight = Flight(
        replace(workspace, vehicle_scale=replace(workspace.vehicle_scale, mass=scale)), seed=11
    )
    flight.follow()
    flight.run(12.0)
    assert flight.sim.min_margin_m is not None
    assert flight.sim.min_margin_m > 0.01
