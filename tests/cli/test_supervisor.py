"""Ways of two processes to end, and what the supervisor says about each."""

from __future__ import annotations

import io
import json
import time
from pathlib import Path

import pytest

from pandion.display import Display
from pandion.supervisor import Flown, ProcessFailed, Supervisor
from tests.cli.command import environment
from tests.cli.fake_processes import event

LISTENING = event("listening", port=1, duration_s=1.0)
FLYING = event("flying")
FLEW = event("ended", result={"completed": True}, vehicle_silent=False)
FLEW_ALONE = event("ended", result={"completed": True}, vehicle_silent=True)
SHUT_DOWN = event("ended", result={"mpc": {}}, ending="shutdown")
LINK_LOST = event("ended", result={"mpc": {}}, ending="link lost")


@pytest.fixture(autouse=True)
def _importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", environment()["PYTHONPATH"])


def watched(out: Path, sitl: list[str], fsw: list[str]) -> Flown:
    supervisor = Supervisor(Display(io.StringIO()), out, runner="tests.cli.fake_processes")
    return supervisor.run([LISTENING, FLYING, *sitl, "0"], lambda port: [*fsw, "0"])


def test_two_results_and_no_failure(tmp_path: Path) -> None:
    flown = watched(tmp_path, ["short", FLEW], [SHUT_DOWN])
    assert (flown.failure, flown.aftermath, flown.unwritten) == (None, [], [])
    assert (flown.sitl, flown.fsw) == ({"completed": True}, {"mpc": {}})


def test_a_half_that_leaves_no_result_is_a_failure(tmp_path: Path) -> None:
    flown = watched(tmp_path, ["short", FLEW], ["short"])
    assert flown.failure == f"fsw ended without a result; see {tmp_path / 'fsw.log'}"


def test_a_simulator_that_leaves_no_result_is_a_failure(tmp_path: Path) -> None:
    flown = watched(tmp_path, ["short"], ["short", SHUT_DOWN])
    assert flown.failure == f"sitl ended without a result; see {tmp_path / 'sitl.log'}"


@pytest.mark.drawn(1)
@pytest.mark.parametrize("reported", [[], [SHUT_DOWN]])
def test_a_process_that_has_to_be_killed_is_a_failure(reported: list[str], tmp_path: Path) -> None:
    begin_s = time.monotonic()
    flown = watched(tmp_path, ["short", FLEW_ALONE], ["deaf", *reported, "sleep"])
    assert flown.aftermath == ["fsw did not end by itself and had to be killed"]
    assert flown.sitl == {"completed": True}
    assert time.monotonic() - begin_s < 3.0


@pytest.mark.long
def test_a_half_that_is_slow_to_end_before_the_flight_is_given_the_time(tmp_path: Path) -> None:
    """What refused the flight is the reason, and all of it."""
    supervisor = Supervisor(Display(io.StringIO()), tmp_path, runner="tests.cli.fake_processes")
    with pytest.raises(ProcessFailed) as failed:
        supervisor.run(["slow", LISTENING, "sleep"], lambda port: ["short", event("error"), "2"])
    assert str(failed.value) == "error said"


def test_an_interrupt_that_is_obeyed_is_not_a_kill(tmp_path: Path) -> None:
    flown = watched(tmp_path, ["sleep"], ["short", LINK_LOST])
    assert flown.aftermath == []
    assert flown.failure is not None
    assert flown.failure.startswith("ended said; sitl ended without a result")


def test_what_could_not_be_written_is_kept_for_the_end(tmp_path: Path) -> None:
    lost = event("unwritten", what="sitl.json: disk full")
    flown = watched(tmp_path, ["short", FLEW, lost], [SHUT_DOWN])
    assert (flown.failure, flown.unwritten) == (None, ["sitl.json: disk full"])


@pytest.mark.requirement("REQ-LINK-10")
def test_a_warning_of_the_vehicle_is_a_line_between_those_of_the_progress(tmp_path: Path) -> None:
    console = io.StringIO()
    supervisor = Supervisor(Display(console), tmp_path, runner="tests.cli.fake_processes")
    progress = event("progress", t_s=0.5, min_margin_m=0.1, real_time_factor=2.0)
    text = {"event": "text", "message": "fsw: 0.5 s: zone \x1b[2J too close"}
    supervisor.run(
        [LISTENING, FLYING, "short", progress, "short", FLEW, "0"],
        lambda port: [json.dumps(text), SHUT_DOWN, "0"],
    )
    lines = console.getvalue().splitlines()
    assert [line for line in lines if "too close" in line] == [
        "fsw: 0.5 s: zone \\x1b[2J too close"
    ]
    assert "flying    0.5 s  ×2.0  margin 100 mm" in lines


@pytest.mark.long
def test_kernels_that_are_compiled_are_counted_until_the_flight_begins(tmp_path: Path) -> None:
    folder, stream = tmp_path / "numba-0", io.StringIO()
    folder.mkdir()
    for name in ("one.nbi", "two.nbi", "two.1.nbc"):
        (folder / name).touch()
    compiling = event("compiling", kernels=4, folder=str(folder))
    supervisor = Supervisor(Display(stream), tmp_path, runner="tests.cli.fake_processes")
    sitl = [LISTENING, compiling, *["short"] * 4, FLYING, "short", FLEW, "0"]
    supervisor.run(sitl, lambda port: [*["short"] * 5, SHUT_DOWN, "0"])
    lines = stream.getvalue().splitlines()
    assert lines.count("compiling 2 of 4 kernels") == 1
    assert "compiling said" in lines


def test_nothing_is_said_of_compiling_where_nothing_is_compiled(tmp_path: Path) -> None:
    stream = io.StringIO()
    supervisor = Supervisor(Display(stream), tmp_path, runner="tests.cli.fake_processes")
    sitl = [LISTENING, *["short"] * 2, FLYING, FLEW, "0"]
    supervisor.run(sitl, lambda port: ["short", "short", SHUT_DOWN, "0"])
    assert "compil" not in stream.getvalue()
