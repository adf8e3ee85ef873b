"""A disk that takes no results: the result all the same, one sentence, and no success."""

from __future__ import annotations

import contextlib
import json
import resource
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from pandion.join_truth import join_truth
from sitl.scenario_file import load_scenario
from sitl.simulation import Simulation
from sitl.truth_log import TruthLog
from tests.cli.command import PANDION, environment, one_sentence, pandion
from tests.processes.both_processes import free_port

FULL = Path("/dev/full")
pytestmark = pytest.mark.skipif(not FULL.is_char_device(), reason="needs /dev/full")


def fly(out: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return pandion(
        "fly", "walls-calm", "--duration", "1", "--api", "none", "--out", str(out),
        "--gcs", f"udp:127.0.0.1:{free_port()}", *options, cwd=out.parent,
    )  # fmt: skip


@pytest.mark.long
def test_results_that_cannot_be_written_are_told_behind_the_verdict(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    names = ("sitl.json", "fsw.json")
    for name in names:
        (out / name).symlink_to(FULL)
    done = fly(out, "--json", str(FULL))
    assert done.returncode == 1
    assert "PASS flew 1.0 s" in done.stdout
    assert "MPC p50" in done.stdout  # the table has what the processes found
    assert one_sentence(done.stderr), done.stderr
    for path in (*(out / name for name in names), FULL):
        assert f"{path}: No space left on device" in done.stderr
    for log in ("sitl.log", "fsw.log"):
        assert "Traceback" not in (out / log).read_text()
    assert json.loads((out / "result.json").read_text())["completed"] is True


def test_a_verdict_that_nobody_can_read_is_no_success(tmp_path: Path) -> None:
    with FULL.open("w") as full:
        done = subprocess.run(
            [*PANDION, "--help"],
            stdout=full,
            stderr=subprocess.PIPE,
            env=environment(),
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert one_sentence(done.stderr), done.stderr


@contextlib.contextmanager
def no_file_longer_than(size: int) -> Iterator[None]:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_log_that_has_no_room_for_the_truth_stays_as_it_is(tmp_path: Path) -> None:
    simulation = Simulation(load_scenario("walls-calm"), 0)
    truth = TruthLog(tmp_path / "truth.ulg", load_scenario("walls-calm"), 0, lambda _: None)
    for _ in range(50):
        truth.add(simulation)
    truth.close()
    flight = tmp_path / "flight.ulg"
    flight.write_bytes(b"the flight so far")
    with no_file_longer_than(2_000):
        join_truth(tmp_path, {"files": {"flight.ulg": {"failure": None}}})
    assert flight.read_bytes() == b"the flight so far"
    assert (tmp_path / "truth.ulg").exists()
