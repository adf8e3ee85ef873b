"""A ground station closes and opens the gripper over UDP, and reads what is in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fsw.autopilot.parameters.flight_config import flight_config
from messages import dialect as d
from sitl.scenario import Payload, vehicle_of
from tests.closed_loop.harness import hover
from tests.conversations.connected import Connected, Message, connected

ARM, DO_GRIPPER = 400, 211
KG = 0.1


def _ask(vehicle: Connected, number: int, *params: float) -> Message:
    padded = (*params, *(0.0,) * (7 - len(params)))
    vehicle.send(d.MAVLink_command_long_message(1, 1, number, 0, *padded))
    return vehicle.run(1.0, lambda m: m.get_type() == "COMMAND_ACK" and m.command == number)


@pytest.mark.requirement("REQ-SAFE-15")
def test_what_the_gripper_holds_is_told_from_the_first_command_on(tmp_path: Path) -> None:
    scenario = replace(hover(), vehicle="probe-2r", payload=Payload(mass_kg=KG, gripper=True))
    config = flight_config(body=scenario.body, vehicle=vehicle_of(scenario))
    with connected(tmp_path, config, scenario) as vehicle:
        assert _ask(vehicle, ARM, 1.0).result == d.MAV_RESULT_ACCEPTED
        vehicle.run(1.0)
        assert not any(m.get_type() == "PAYLOAD_STATUS" for m in vehicle.heard)
        grabbed = _ask(vehicle, DO_GRIPPER, 1.0, d.GRIPPER_ACTION_GRAB)
        assert grabbed.result == d.MAV_RESULT_ACCEPTED
        vehicle.run(3.0)
        told = vehicle.run(1.0, lambda m: m.get_type() == "PAYLOAD_STATUS")
        assert told.get_srcComponent() == 25
        assert told.gripper == d.GRIPPER_ACTION_GRAB
        assert told.mass == pytest.approx(KG, rel=0.05)
        _ask(vehicle, DO_GRIPPER, 1.0, d.GRIPPER_ACTION_RELEASE)
        vehicle.run(0.5)
        told = vehicle.run(1.0, lambda m: m.get_type() == "PAYLOAD_STATUS")
        assert told.gripper == d.GRIPPER_ACTION_RELEASE
        assert told.mass == 0.0
