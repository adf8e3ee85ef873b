"""Vehicles that come with Pandion fly by their files, and none needs machine code of its own."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import pytest

from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.compiled import compiled_so_far
from sitl.scenario import Scenario, vehicle_of
from sitl.scenario_file import load_scenario
from studies.flight.closed_loop import simulate
from studies.flight.result import FlightResult
from vehicles.vehicle_file import vehicle_names

OTHERS = [name for name in vehicle_names() if name != "paper"]


def scenario(name: str, vehicle: str, duration_s: float, suite: str | None = None) -> Scenario:
    return replace(load_scenario(name, suite, vehicle), duration_s=duration_s)


def flown(one: Scenario, seed: int = 0) -> FlightResult:
    return simulate(one, seed, flight_config(body=one.body, vehicle=vehicle_of(one)))


@pytest.mark.drawn(1)
@pytest.mark.parametrize(("vehicle", "suite"), list(product(OTHERS, (None, "mocap"))))
def test_it_flies_between_walls_within_its_limits(vehicle: str, suite: str | None) -> None:
    keeps_its_limits(vehicle, suite, 13.0)


@pytest.mark.long
@pytest.mark.parametrize(("vehicle", "suite"), list(product(OTHERS, (None, "mocap"))))
def test_it_flies_between_walls_for_longer(vehicle: str, suite: str | None) -> None:
    keeps_its_limits(vehicle, suite, 25.0)


def keeps_its_limits(vehicle: str, suite: str | None, seconds: float) -> None:
    truth = flown(scenario("walls", vehicle, seconds, suite)).truth
    assert truth.completed, truth.end_reason
    assert truth.min_margin_m is not None
    assert truth.min_margin_m > 0.01
    assert truth.tracking_error_max_m is not None
    assert truth.tracking_error_max_m < 0.25
    assert [key for key, use in truth.limits.items() if not use.kept] == []


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
def test_what_pushes_make_of_a_heavy_arm_is_no_gyro_s_fault() -> None:
    """The flight held after 2.5 s: pushes had turned it by 1.6 rad/s in two seconds."""
    truth = flown(scenario("walls", "hexa-3r", 4.0, "mocap"), seed=209).truth
    assert truth.completed, truth.end_reason


def test_a_second_vehicle_compiles_nothing() -> None:
    config = flight_config()
    Planner(config.planner, config.airframe, lambda: 0.0).warm_up()  # as before any flight
    Autopilot(config).warm_up()
    flown(scenario("walls", "paper", 1.0, "mocap"))
    flown(scenario("walls", "paper", 1.0))
    before = compiled_so_far()
    assert before > 10
    for vehicle in OTHERS:
        flown(scenario("walls", vehicle, 1.0, "mocap"))
        flown(scenario("walls", vehicle, 1.0))
    assert compiled_so_far() == before
