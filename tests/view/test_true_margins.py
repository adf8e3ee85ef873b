"""Places of any vehicle, from the simulator's state in a log."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fsw.autopilot.model.airframe import airframe_of
from sitl.scenario_file import load_scenario
from vehicles.vehicle_file import load_vehicle
from view.flight_data import Table
from view.scene import Posture
from view.true_margins import true_margins
from view.vehicle import chain

P, Q = (1.0, -2.0, -1.5), (0.96, 0.0, 0.28, 0.0)


@pytest.mark.parametrize("name", ["paper", "hexa-3r", "octo-4r"])
def test_parts_of_any_vehicle_are_where_its_arm_is(name: str) -> None:
    vehicle = load_vehicle(name)
    q_arm = (0.3, -0.4, 0.5, 0.2)[: len(vehicle.joints)]
    columns = {
        "p_WB": P, "v_WB": (0.0,) * 3, "q_WB": Q, "w_WB_B": (0.0,) * 3,
        "thrust": (5.0,) * len(vehicle.rotors), "q_arm": q_arm, "qd_arm": (0.0,) * len(q_arm),
    }  # fmt: skip
    table = Table("truth", np.zeros(1), {key: np.array([one]) for key, one in columns.items()})
    flight: Any = SimpleNamespace(tables={"sim_ground_truth": table}, begin=0.0)
    found = true_margins(flight, load_scenario("walls", None, name))
    assert found is not None
    tip = chain(Posture(P, Q, q_arm), airframe_of(vehicle))[-1]
    np.testing.assert_allclose(found.places[0, 0], P)
    np.testing.assert_allclose(found.places[0, found.tip], tip, atol=1e-9)
    assert found.near["end_effector"] == found.tip
    assert {key.partition("/")[2] for key in found.keys} <= found.near.keys()
