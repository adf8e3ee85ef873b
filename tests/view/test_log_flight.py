"""Tests of a flight as the page asks for it, from a log whose every number is known."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.signals import PlanInput, PredictionState
from tests.view.flights import BALL, HEIGHT, OFFSET_M, SPIKE_N, WORST_M, WORST_S, write_flight
from vehicles.vehicle_file import load_vehicle, vehicle_text
from view.flight_data import UlogError
from view.log_flight import LogFlight
from view.scene import Posture
from view.vehicle import airframe_of, chain, horizon

BEGIN_S = 1.0


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> LogFlight:
    return LogFlight(write_flight(tmp_path_factory.mktemp("one") / "flown"))


def test_a_moment_has_estimate_and_truth_beside_each_other(flight: LogFlight) -> None:
    scene = flight.scene(BEGIN_S + 3.0)
    assert scene.truth is not None
    assert scene.truth.p == pytest.approx((0.85, 0.0, HEIGHT))
    assert scene.estimate is not None
    np.testing.assert_allclose(np.subtract(scene.estimate.p, scene.truth.p), OFFSET_M, atol=1e-6)
    assert (scene.mode, scene.armed, scene.failures) == ("trajectory", True, "no plan")
    assert scene.torque == pytest.approx((0.1, -0.1))


def test_a_tick_is_found_to_the_tick(flight: LogFlight) -> None:
    before, at, after = (flight.scene(BEGIN_S + t).thrust for t in (2.001, 2.003, 2.005))
    assert before is not None
    assert at is not None
    assert after is not None
    assert (before[0] < 9.0, at[0], after[0] < 9.0) == (True, SPIKE_N, True)


def test_a_spike_of_one_tick_is_in_the_curves(flight: LogFlight) -> None:
    curve = next(one for one in flight.curves() if one.title.startswith("rotor thrust"))
    assert max(curve.rows[0]) == SPIKE_N
    assert len(curve.t) <= 1500


def test_the_worst_moment_is_that_of_the_result(flight: LogFlight, tmp_path: Path) -> None:
    assert flight.worst is not None
    assert (flight.worst.t, flight.worst.margin) == (BEGIN_S + WORST_S, WORST_M)
    alone = write_flight(tmp_path / "alone")
    (alone / "sitl.json").unlink()
    own = LogFlight(alone).worst
    assert own is not None
    assert own.source == "the vehicle's own estimate"
    other = json.loads((alone / "result.json").read_text())
    (alone / "sitl.json").write_text(json.dumps({**other, "min_margin_m": 9.0}))
    again = LogFlight(alone).worst
    assert again is not None
    assert again.source == "the vehicle's own estimate", "they are of different flights"


def test_a_moment_has_the_margin_that_is_nearest_in_time(tmp_path: Path) -> None:
    """They are logged ten times a second: the worst moment had the one of 0.1 s before."""
    flight = LogFlight(write_flight(tmp_path / "flown"))
    table = flight.data.tables["barrier_margin"]
    margins = np.linspace(1.0, 0.0, len(table))
    columns = {**table.columns, "minimum": margins}
    flight.data.tables["barrier_margin"] = replace(table, columns=columns)
    for k in (1, 2, len(table) - 1):
        for t in (table.t[k] - 0.004, table.t[k], table.t[k] + 0.004):
            assert flight.scene(t).minimum == margins[k]
    assert math.isnan(flight.scene(table.t[0] - 1.0).minimum)
    assert flight.scene(table.t[-1] + 1.0).minimum == margins[-1]


def test_the_safe_set_is_the_announced_one(flight: LogFlight) -> None:
    safe_set = flight.scene(BEGIN_S + 1.0).safe_set
    assert safe_set is not None
    assert safe_set.zones[1] == BALL
    assert flight.safe_set(BEGIN_S - 0.5) is None


def test_the_region_holds_the_flight(flight: LogFlight) -> None:
    low, high = flight.region()
    assert low[0] < 0.5 < 0.85 < high[0]
    assert low[2] < HEIGHT
    assert high[2] >= 0.0


def test_a_log_without_places_is_refused(tmp_path: Path) -> None:
    from tests.view.test_flight_data import PLACE, record, write

    path = write(tmp_path / "flight.ulg", record(0, PLACE, 1, 0.0, 0.0, 0.0, b""))
    with pytest.raises(UlogError, match="says nothing about where the vehicle was"):
        LogFlight(path)


def test_the_arm_hangs_where_the_model_has_it() -> None:
    quarter = np.sqrt(0.5)
    east = Posture((1.0, 2.0, -3.0), (quarter, 0.0, 0.0, quarter), (np.pi / 2, -np.pi / 2))
    joint2, tip = chain(east, AIRFRAME)[1:]
    assert joint2 == pytest.approx((1.0, 2.15, -3.0))
    assert tip == pytest.approx((1.0, 2.15, -2.85))


def test_a_plan_leads_to_where_its_inputs_push() -> None:
    rest = PredictionState(
        (0.0, 0.0, -1.0), (0.1, 0.0, 0.0), (0.0,) * 3, (0.0,) * 2, (0.0,) * 2, 0.0, 0.0,
        (0.0,) * 2, (0.0,) * 2,
    )  # fmt: skip
    idle = PlanInput((0.0, 0.0, 0.0), 0.0, (0.0, 0.0))
    drift = horizon(rest, (idle,) * 4, 0.1, AIRFRAME)
    assert drift.base[-1] == pytest.approx((0.04, 0.0, -1.0))
    assert drift.tip[-1] == pytest.approx((0.04, 0.0, -0.7))


def test_the_airframe_is_the_logged_one() -> None:
    octo = load_vehicle("octo-4r")
    logged = {
        "vehicle": "octo-4r",
        "vehicle_file": vehicle_text(octo),
        "numbers": json.dumps({"airframe.rotor_lag": 0.03, "airframe.rotor_thrust_max": 20.0}),
    }
    airframe = airframe_of(logged)
    assert (airframe.rotors, airframe.bodies.joints) == (8, 4)
    assert (airframe.rotor_lag, airframe.weakest_thrust) == (0.03, 20.0)
    assert airframe_of({}) == airframe_of({"numbers": "{"}) == AIRFRAME
    assert airframe_of({"vehicle_file": "no = vehicle"}) == AIRFRAME
