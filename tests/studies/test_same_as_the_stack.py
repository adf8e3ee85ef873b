"""A study flies what the whole stack flies: the lockstep over UDP gives the same flight."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from sitl.scenario_file import load_scenario
from studies.cases import configuration
from studies.job import Job, fly_job

DURATION_S = 2.0
SEED = 100


@pytest.mark.parametrize("suite", ["perfect", pytest.param("mocap", marks=pytest.mark.long)])
def test_in_process_and_over_the_wire_are_one_flight(suite: str, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
        ground.bind(("127.0.0.1", 0))
        result = tmp_path / "result.json"
        words = ["workspace", f"--seed={SEED}", f"--duration={DURATION_S}", f"--json={result}"]
        words += [
            f"--sensors={suite}",
            "--api=none",
            f"--gcs=udp:127.0.0.1:{ground.getsockname()[1]}",
            f"--out={tmp_path / 'out'}",
        ]
        command = [sys.executable, "-m", "pandion", "fly", *words]
        subprocess.run(command, check=True, capture_output=True, timeout=300)
    wire = json.loads(result.read_text())
    flown = replace(load_scenario("workspace", suite), duration_s=DURATION_S)
    here = fly_job(Job("full", flown, replace(configuration("full"), soft=False), SEED))
    # The wire rounds to single precision: 1e-7 of a metre or so, and feedback keeps it there.
    truth = here.truth
    assert wire["min_margin_m"] == pytest.approx(truth.min_margin_m, abs=1e-5)
    assert wire["tracking_error_rms_m"] == pytest.approx(truth.tracking_error_rms_m, abs=1e-5)
    assert wire["control_effort"]["sum"] == pytest.approx(here.planner.metrics.effort, rel=1e-3)
    assert wire["control_smoothness"]["sum"] == pytest.approx(
        here.planner.metrics.smoothness, rel=1e-3
    )
