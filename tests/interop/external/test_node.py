"""node-mavlink as client; run by ``make interop``."""

from __future__ import annotations

import json
import subprocess

import pytest

from tests.interop.external.environments import environment_of, only_where_installed
from tests.interop.vehicle import REAL_TIME, Vehicle
from tests.parameters_on_the_wire import LISTED

PACING = REAL_TIME
pytestmark = only_where_installed
ARM, UNKNOWN = "400", "31010"
ACCEPTED, UNSUPPORTED = 0, 3


def test_node_mavlink_reads_and_commands_the_vehicle(vehicle: Vehicle) -> None:
    client = environment_of("node") / "client.mjs"
    reported = subprocess.run(
        ["node", str(client), str(vehicle.gcs_port)], capture_output=True, text=True, check=True
    )
    seen = json.loads(reported.stdout)
    assert {"HEARTBEAT", "ATTITUDE", "LOCAL_POSITION_NED", "SYS_STATUS"} <= set(seen["messages"])
    assert seen["messages"]["ATTITUDE"] > 100
    assert seen["acks"] == {ARM: ACCEPTED, UNKNOWN: UNSUPPORTED}
    assert seen["armed"]
    seen["parameters"].pop("_HASH_CHECK", None)  # the checksum of all
    negative = {name for name, value in LISTED.items() if isinstance(value, int) and value < 0}
    assert {name for name, value in seen["parameters"].items() if value is None} == negative
    known = {name: value for name, value in seen["parameters"].items() if value is not None}
    expected = {name: value for name, value in LISTED.items() if name not in negative}
    assert known == pytest.approx(expected, rel=1e-6, abs=1e-9)
