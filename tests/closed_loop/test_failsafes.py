"""Flights that end in a failsafe: without a planner, and without a position."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fsw.autopilot.measurements import GnssSample, PoseSample
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode
from sitl.scenario import Hold, Pilot, ScenarioWall
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, SET_MODE, Flight, command, hover, real_planner
from tests.closed_loop.test_lost_sensors import NOTHING, lies
from tests.closed_loop.test_real_sensors import changed
from tests.closed_loop.test_when_things_go_wrong import FailsFrom

FOR_GOOD = 10**6
LONGEST_S = 40


def to_the_ground(flight: Flight) -> float:
    """Fly until the vehicle has disarmed itself; how fast it was on the way down [m/s]."""
    fastest = 0.0
    while flight.mode is not Mode.DISARMED or flight.sim.step < 10:
        flight.step()
        assert flight.sim.ended is None, flight.sim.ended
        assert flight.sim.step < LONGEST_S * 500, flight.texts
        if flight.mode is Mode.DESCEND:
            fastest = max(fastest, flight.sim.truth().v_WB[2])
    assert flight.modes[-2:] == [Mode.DESCEND, Mode.DISARMED]
    assert flight.texts[-1] == "descend to disarmed: touched down"
    return fastest


@pytest.mark.requirement("REQ-MODE-5", "REQ-PLAN-3")
@pytest.mark.long
def test_a_vehicle_whose_planner_is_lost_descends_where_it_is() -> None:
    config = flight_config(body="points")
    flight = Flight(hover(), config=config, planner=FailsFrom(real_planner(config), 20))
    flight.step(command(ARM, 1.0))
    flight.run(8.0)
    assert flight.mode is Mode.DESCEND
    here = flight.sim.truth().p_WB
    flight.step(command(SET_MODE, 1.0, 4.0, 3.0))
    assert flight.texts[-1] == "no hold: planner lost; the vehicle descends"
    assert to_the_ground(flight) < 0.35
    assert math.dist(flight.sim.truth().p_WB[:2], here[:2]) < 0.02
    assert sum("planner lost" in text and "descending" in text for text in flight.texts) == 1


@pytest.mark.requirement("REQ-EST-5")
@pytest.mark.long
def test_a_vehicle_without_a_position_descends_where_it_is() -> None:
    flight = Flight(hover(), spoil=lies(FOR_GOOD, 500, p_WB=NOTHING))
    flight.step(command(ARM, 1.0))
    assert to_the_ground(flight) < 0.55  # twice the speed of landing, 0.25 m/s
    assert math.hypot(*flight.sim.truth().p_WB[:2]) < 0.3
    assert any("position unknown" in text and "descending" in text for text in flight.texts)


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-5", "REQ-SAFE-11")
def test_a_vehicle_without_satellites_draws_back_from_the_wall_while_it_descends() -> None:
    """Early, so that it must do so in Descend: a hold does by itself."""
    config = flight_config(body="points")
    limits = replace(config.limits, position_low=0.02, position_lost=0.05)
    near = ScenarioWall("right", (0.0, -1.0, 0.0), -1.2, 0.3)
    field = replace(load_scenario("field", "rtk"), walls=(near,), disturbances=())
    scenario = replace(field, trajectory=Hold((0.0, 0.0, -2.5)), pilot=Pilot("none"))
    spoil = changed(GnssSample, 0.5, 999.0, lambda _: None)
    flight = Flight(scenario, config=replace(config, limits=limits), spoil_samples=spoil)
    flight.step(command(ARM, 1.0))
    while flight.mode is not Mode.DESCEND:
        flight.step()
        assert flight.sim.time_s < 2.0
    begin_s, begin = flight.sim.time_s, flight.snapshot.estimate
    assert to_the_ground(flight) > 1.2  # m/s: the height is measured, and there is time to brake
    assert flight.sim.time_s - begin_s < 5.0
    # It draws back, ever slower, until its speed is no better known than to 1 m/s or its legs touch
    # within half a second: 0.29 m in all.
    assert flight.snapshot.estimate.p_WB[1] < begin.p_WB[1] - 0.2, "away from the wall"
    assert min(flight.sim.truth().margins_m) > 0.3


@pytest.mark.requirement("REQ-MODE-9")
@pytest.mark.long
def test_a_vehicle_that_drifts_feels_the_ground_though_its_height_has_drifted() -> None:
    spoil = changed(PoseSample, 3.0, 999.0, lambda _: None)
    scenario = replace(load_scenario("walls", "mocap"), duration_s=60.0)
    flight = Flight(scenario, spoil_samples=spoil)
    flight.follow()
    assert to_the_ground(flight) < 0.7  # twice the speed of landing, and what it drifts
    assert math.dist(flight.snapshot.estimate.p_WB, flight.sim.truth().p_WB) > 0.3
    assert not any("pushed off" in text for text in flight.texts), "zones are not where they seem"
