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


def no_long_files() -> None:
    # A flight of 4 s writes more into each of its logs.
    resource.setrlimit(resource.RLIMIT_FSIZE, (250_000, 250_000))


@pytest.mark.long
def test_logs_that_end_early_are_results_that_could_not_be_written(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = subprocess.run(
        [
            *(*PANDION, "fly", "walls-calm", "--duration", "4", "--api", "none"),
            *("--gcs", f"udp:127.0.0.1:{free_port()}", "--out", str(out)),
        ],
        capture_output=True,
        env=environment(),
        text=True,
        preexec_fn=no_long_files,
        check=False,
    )
    assert done.returncode == 1, done.stdout + done.stderr
    assert "PASS flew 4.0 s" in done.stdout
    assert one_sentence(done.stderr), done.stderr
    wanted = {f"{out / name}: File too large" for name in ("flight.ulg", "truth.ulg")}
    result, sitl, fsw = (
        json.loads((out / f"{name}.json").read_text()) for name in ("result", "sitl", "fsw")
    )
    assert {*result["unwritten"]} >= wanted
    assert all(one in done.stderr for one in wanted)
    assert result["completed"]
    assert sitl["unwritten"] == [f"{out / 'truth.ulg'}: File too large"]
    assert fsw["files"]["flight.ulg"]["failure"] == "File too large"
    replayed = pandion("replay", str(out), "--verify", "--json", "found.json", cwd=tmp_path)
    assert "the log does not say that it ends there" in replayed.stdout
    assert json.loads((tmp_path / "found.json").read_text())["whole"] is False
    page = pandion("report", str(out), "--html", "page.html", cwd=tmp_path)
    assert page.returncode == 0, page.stderr
    assert "truth.ulg: File too large" in (tmp_path / "page.html").read_text()


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


def test_a_truth_that_ends_early_or_is_deleted_is_lost_and_told_once(tmp_path: Path) -> None:
    simulation = Simulation(load_scenario("walls-calm"), 0)
    told: list[str] = []
    path = tmp_path / "truth.ulg"
    for reason in ("File too large", "the file was deleted"):
        truth = TruthLog(path, load_scenario("walls-calm"), 0, told.append)
        for _ in range(50):
            truth.add(simulation)
        assert truth.file.lost == []
        if reason == "File too large":
            with no_file_longer_than(2_000):
                truth.close()
        else:
            path.unlink()
            truth.close()
        assert truth.file.lost == [f"{path}: {reason}"]
    assert told == [
        "truth.ulg ends early: File too large",
        "truth.ulg ends early: the file was deleted",
    ]


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
