"""What describes the vehicle and its clocks is written once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.prediction import discretise
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.signals import Plan
from fsw.autopilot.tuning import flat
from tests.fsw.autopilot.mpc.requests import below, hovering, request


@given(st.floats(0.01, 0.2))
def test_a_predicted_vertical_acceleration_follows_as_the_rotors_do(rotor_lag: float) -> None:
    a, _ = discretise(replace(AIRFRAME, rotor_lag=rotor_lag), 0.1)
    assert np.isclose(a[8, 8], np.exp(-0.1 / rotor_lag))


@pytest.mark.parametrize(
    ("word", "paths"),
    [
        ("rotor_lag", ["airframe.rotor_lag"]),
        ("limits.tilt", ["planner.limits.tilt"]),
        ("period", ["planner.period_us", "tick_period_us"]),
        ("home_posture", [f"airframe.home_posture.{k}" for k in range(6)]),
    ],
)
def test_a_number_of_the_vehicle_is_configured_in_one_place(word: str, paths: list[str]) -> None:
    assert [path for path in flat(FlightConfig()) if word in path] == paths


def test_a_barrier_too_quick_for_the_planners_period_is_refused() -> None:
    planner = flight_config().planner
    with pytest.raises(ValueError, match=r"must not exceed 5\.0 1/s"):
        replace(planner, period_us=200_000, walls=replace(planner.walls, slope=6.0))


def test_the_planner_predicts_with_the_airframe_it_is_given() -> None:
    config = flight_config()
    slow = replace(config.airframe, rotor_lag=0.2)
    plans = [
        Planner(config.planner, airframe, lambda: 0.0).plan(
            request(hovering(), below((0.5, 0.0, -1.2)))
        )
        for airframe in (config.airframe, slow)
    ]
    assert all(isinstance(plan, Plan) for plan in plans)
    assert plans[0] != plans[1]
