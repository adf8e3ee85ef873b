"""A push that lasts is cancelled, and clearances have grown by what it can do when it turns."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sitl.scenario import Wind
from sitl.scenario_file import parse_scenario
from tests.closed_loop.harness import ARM, BESIDE_A_WALL, Flight, command

PUSH = 0.5  # m/s^2, north, where the wall is


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
