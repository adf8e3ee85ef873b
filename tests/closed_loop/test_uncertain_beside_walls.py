"""A vehicle that does not know where it is draws back from walls, by itself and only then."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.measurements import PoseSample
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode
from sitl.scenario import Hold, Pilot, ScenarioWall
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, Flight, command
from tests.closed_loop.test_real_sensors import Spoil, changed, frozen

LOST_S, BACK_S = 1.5, 3.5  # of the flight; so early, the biases are hardly known
RIGHT = ScenarioWall("right", (0.0, -1.0, 0.0), -0.3, 0.1)
LEFT = ScenarioWall("left", (0.0, 1.0, 0.0), -0.3, 0.1)
LOST: Spoil = changed(PoseSample, LOST_S, BACK_S, lambda _: None)


def beside(*walls: ScenarioWall, spoil: Spoil = LOST, sigmas: float = 3.0) -> Flight:
    """A hover with motion capture and no disturbance, 0.2 m off walls, until the pose is lost."""
    config = flight_config(body="points")
    config = replace(config, limits=replace(config.limits, clearance_sigmas=sigmas))
    calm = replace(load_scenario("walls", "mocap"), walls=walls, disturbances=())
    hover = replace(calm, trajectory=Hold((0.0, 0.0, -1.2)), pilot=Pilot("none"))
    flight = Flight(hover, config=config, spoil_samples=spoil)
    flight.step(command(ARM, 1.0))
    flight.run(LOST_S)
    return flight


def east(flight: Flight) -> float:
    """Where the vehicle believes to be."""
    assert flight.state.estimate is not None
    return flight.state.estimate.p_WB[1]


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-11")
@pytest.mark.parametrize(
    "spoil",
    [LOST, changed(PoseSample, LOST_S, BACK_S, frozen())],
    ids=["lost", "frozen"],
)
def test_a_vehicle_whose_pose_is_lost_draws_back_from_the_wall_and_returns(spoil: Spoil) -> None:
    flight = beside(RIGHT, spoil=spoil)
    places, grown = [flight.sim.truth().p_WB[1]], [max(flight.state.kept.added)]
    for _ in range(4):
        flight.run(0.5)
        places.append(flight.sim.truth().p_WB[1])
        grown.append(max(flight.state.kept.added))
        # Three deviations are kept at every time, and some of the reserve for disturbances.
        assert min(flight.state.constraints.margins) > max(flight.state.kept.spread) + 0.02
    assert grown == sorted(grown)
    assert grown[-1] > 0.1
    assert places[-1] < places[0] - 0.1, "away from the wall"
    flight.run(3.0)
    assert max(flight.state.kept.added) < 0.01
    assert abs(flight.sim.truth().p_WB[1] - places[0]) < 0.03
    assert flight.mode is Mode.HOLD


@pytest.mark.long
def test_it_stays_where_clearances_do_not_grow() -> None:
    flight = beside(RIGHT, sigmas=0.0)
    begin = east(flight)
    flight.run(2.0)
    assert abs(east(flight) - begin) < 0.02


@pytest.mark.requirement("REQ-SAFE-11")
def test_between_two_walls_it_stays_in_their_middle_and_says_what_room_is_lacking() -> None:
    flight = beside(LEFT, RIGHT)
    flight.run(2.0)
    assert abs(east(flight)) < 0.02
    assert any(Condition.ROOM_LACKING.value in text for text in flight.texts), flight.texts
    assert all(0.05 < more < 0.15 for more in flight.state.kept.added)
