"""mavpilot, autopilot-tools, dronekit and mavkit as clients; run by ``make interop``."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any, cast

from tests.interop.external.environments import environment_of, only_where_installed
from tests.interop.vehicle import REAL_TIME, Vehicle
from tests.parameters_on_the_wire import LISTED

PACING = REAL_TIME
pytestmark = only_where_installed


def result_of(client: str, vehicle: Vehicle) -> dict[str, Any]:
    """What a client learnt of the vehicle."""
    program = Path(__file__).with_name("companions.py")
    python = environment_of("companions") / "bin" / "python"
    done = subprocess.run(
        [python, program, client, str(vehicle.api_port)],
        capture_output=True,
        text=True,
        timeout=120.0,
    )
    assert done.returncode == 0, done.stdout[-1000:] + done.stderr[-3000:]
    return cast("dict[str, Any]", json.loads(done.stdout.splitlines()[-1]))


def test_mavpilot_verifies_its_safety_parameters_and_is_ready(vehicle: Vehicle) -> None:
    assert result_of("mavpilot", vehicle) == {"ready": True}


def test_autopilot_tools_sets_and_resets_parameters_and_finds_the_log(vehicle: Vehicle) -> None:
    found = result_of("autopilot-tools", vehicle)
    assert found["written"] == [3, 1.5]
    assert found["reset"] == LISTED["NAV_DLL_ACT"]
    assert bytes.fromhex(found["log"]) == b"ULog\x01\x12\x35"
    assert len(set(found["names"])) == 1


def test_dronekit_finds_what_it_waits_for(vehicle: Vehicle) -> None:
    found = result_of("dronekit", vehicle)
    assert found["fix"] == 3
    assert found["parameters"] >= len(LISTED)


def test_mavkit_has_a_fix_and_px4_s_types(vehicle: Vehicle) -> None:
    types = result_of("mavkit", vehicle)["types"]
    types.pop("_HASH_CHECK", None)  # the checksum of all
    kinds = {n: "Int32" if isinstance(v, int) else "Real32" for n, v in LISTED.items()}
    assert types == kinds
