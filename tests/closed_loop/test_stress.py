"""A vehicle or a wind that is not as believed, beside walls: nothing is hit, and nothing is silent.

None of these can be known before flight. Where the loop still holds, the flight is completed; where
it does not, the vehicle goes off the walls and holds, and says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace

import pytest

from pandion.result import FlightReports, as_json, table_rows
from sitl.result import EndKind
from sitl.scenario import Scenario, VehicleScale, Wind
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import Flight

SEEDS = range(100, 105)


def scaled(scale: VehicleScale) -> Callable[[Scenario], Scenario]:
    return lambda flown: replace(flown, vehicle_scale=scale)


def windy(north: float, east: float) -> Callable[[Scenario], Scenario]:
    """On top of the random disturbance of 0.8 m/s² an axis."""
    wind = Wind((north, east, 0.0))
    return lambda flown: replace(flown, disturbances=(*flown.disturbances, wind))


HELD = {
    "joint friction x1.7": scaled(VehicleScale(joint_friction=1.7)),
    "rotor lag x1.5": scaled(VehicleScale(rotor_lag=1.5)),
}
LOST = {
    "rotor lag x2": scaled(VehicleScale(rotor_lag=2.0)),
    "wind of 0.9 m/s2 at the front wall": windy(0.9, 0.0),
    "wind of 0.9 m/s2 at a side wall": windy(0.0, 0.9),
    "wind of 0.9 m/s2 at the corner": windy(0.636, 0.636),
}


def flown(change: Callable[[Scenario], Scenario], seed: int) -> Flight:
    """A whole flight of Case I."""
    flight = Flight(change(load_scenario("walls")), seed=seed)
    flight.follow()
    while flight.sim.ended is None:
        flight.step()
    return flight


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("change", HELD.values(), ids=HELD.keys())
def test_what_the_loop_can_take_is_flown_to_the_end_inside_the_safe_set(
    change: Callable[[Scenario], Scenario], seed: int
) -> None:
    flight = flown(change, seed)
    result, ended = flight.sim.result(), flight.sim.ended
    assert ended is not None
    assert ended.kind is EndKind.DURATION, ended.sentence
    assert min(result.margins_m.values()) > 0.02
    assert flight.snapshot.safety.breaches == 0
    assert result.completed, result.end_reason


@pytest.mark.requirement("REQ-SAFE-4")
@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("change", LOST.values(), ids=LOST.keys())
def test_what_it_cannot_take_hits_nothing_and_is_told(
    change: Callable[[Scenario], Scenario], seed: int
) -> None:
    flight = flown(change, seed)
    result, ended = flight.sim.result(), flight.sim.ended
    assert ended is not None
    assert ended.kind is EndKind.DURATION, ended.sentence
    assert min(result.surfaces_m.values()) > 0.03
    least = min(result.margins_m.values())
    told = [text for text in flight.texts if text.startswith("failsafe: outside the safe set")]
    counts = flight.snapshot.safety
    assert bool(told) is (counts.breaches > 0)
    if least < 0.0:
        assert told
        assert not result.completed
        assert "margin was violated" in result.end_reason
        vehicle = {"safety": asdict(counts)}
        reports = FlightReports("walls", seed, "blf", asdict(result), vehicle, None, {})
        rows = dict(table_rows(as_json(reports), None))
        assert int(rows["breaches / off plan / filter"].split(" / ")[0]) > 0
