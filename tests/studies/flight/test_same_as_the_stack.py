"""A study flies what the whole stack flies: the lockstep over UDP gives the same flight."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from pyulog import ULog

from sitl.scenario_file import load_scenario
from sitl.simulation import START_US
from studies.flight.job import Job, fly_job
from studies.paper.cases import configuration


def read(log: Path) -> dict[int, tuple[float, float, float]]:
    """True positions of the base in a log [m, NED], by their stamps [us]."""
    (topic,) = ULog(str(log), ["sim_ground_truth"]).data_list
    p = [topic.data[f"p_WB[{axis}]"].tolist() for axis in range(3)]
    return dict(zip(topic.data["timestamp"].tolist(), zip(*p, strict=True), strict=True))


DURATION_S = 2.0
SEED = 100


@pytest.mark.long
@pytest.mark.parametrize(
    ("suite", "apart"),
    [("perfect", 1e-5), ("mocap", 3e-5)],
)
def test_in_process_and_over_the_wire_are_one_flight(
    suite: str, apart: float, tmp_path: Path
) -> None:
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
    job = Job("full", flown, replace(configuration("full"), soft=False), SEED)
    here = fly_job(job, traced=True)
    truth = here.truth
    # To the last bit: where it begins, when and why it ends, how often it planned.
    path = read(tmp_path / "out" / "flight.ulg")
    first, *later = here.planner.trace
    assert path[START_US] == first.p_WB
    assert wire["duration_s"] == truth.duration_s
    assert wire["end_reason"] == truth.end_reason
    # The wire rounds to single precision, some 1e-7 m, and feedback keeps it there; an estimate
    # from rounded readings of an inertial unit wanders farther.
    both = [(point.p_WB, path.get(START_US + round(1e6 * point.t_s))) for point in later]
    seen = [(ours, theirs) for ours, theirs in both if theirs is not None]
    assert len(seen) >= 0.4 * len(later)
    for ours, theirs in seen:
        assert theirs == pytest.approx(ours, abs=apart)
    assert wire["min_margin_m"] == pytest.approx(truth.min_margin_m, abs=apart)
    assert wire["tracking_error_rms_m"] == pytest.approx(truth.tracking_error_rms_m, abs=apart)
    assert wire["control_effort"]["sum"] == pytest.approx(here.planner.metrics.effort, rel=1e-3)
    assert wire["control_smoothness"]["sum"] == pytest.approx(
        here.planner.metrics.smoothness, rel=1e-3
    )
