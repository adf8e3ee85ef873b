"""`pandion fly` from the outside: the result, the telemetry, the log, and every way to end it."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from pymavlink import mavutil

from fsw.link.telemetry.streams import STREAMS
from messages.message_ids import ORBIT_EXECUTION_STATUS, PANDION, PAYLOAD_STATUS, TOOL_CONTACT
from tests.cli.command import clean_up, group_is_empty, read_until, start
from tests.cli.heard_flight import Flight, flown
from tests.processes.both_processes import free_port


def documented() -> dict[str, list[str]]:
    """The keys that the page of the result promises, and the names in the meaning of each."""
    (page,) = (Path(__file__).parents[2] / "docs").rglob("result.md")
    rows = re.findall(r"^\| (`.*?) \| (.*) \|$", page.read_text(), re.MULTILINE)
    return {
        key: re.findall(r"`(\w+)`", meaning)
        for keys, meaning in rows
        for key in re.findall(r"`(\w+)`", keys)
    }


@pytest.fixture(scope="module")
def realtime(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    arguments = ("workspace-calm", "--duration", "3", "--realtime")
    return flown(tmp_path_factory.mktemp("realtime"), *arguments)


def test_the_result_has_exactly_the_keys_that_its_page_promises(lockstep: Flight) -> None:
    result, promised = lockstep.result, documented()
    assert set(result) == set(promised)
    for key in ("mpc", "inner", "control_effort"):
        assert set(result[key]) == set(promised[key])
    assert (result["scenario"], result["seed"], result["controller"]) == ("walls", 2, "blf")
    assert result["vehicle"] == "paper"
    assert result["completed"] is True
    assert result["duration_s"] == pytest.approx(3.0)
    assert result["min_margin_m"] == min(result["margins_m"].values())
    assert result["mpc"]["horizon"] == 5
    assert sum(result["mpc"]["status"].values()) == pytest.approx(30, abs=2)
    assert result["control_effort"]["sum"] > 0.0


def test_the_verdict_is_told_and_the_files_are_there(lockstep: Flight) -> None:
    reported = lockstep.done.stderr
    assert "PASS" in reported
    assert ": walls, seed 2, vehicle paper, " in reported
    assert "QGroundControl connects on UDP" in reported
    assert "minimum margin" in reported
    assert lockstep.directory.name == "walls-seed2-1"
    assert {"flight.tlog", "fsw.json", "sitl.json", "result.json"} <= set(lockstep.files)
    assert json.loads((lockstep.directory / "result.json").read_text()) == lockstep.result


@pytest.mark.parametrize("mode", ["lockstep", pytest.param("realtime", marks=pytest.mark.long)])
def test_a_listener_hears_every_stream_at_its_rate(
    mode: str, request: pytest.FixtureRequest
) -> None:
    flight: Flight = request.getfixturevalue(mode)
    seconds = flight.result["duration_s"]
    counts = Counter((frame.component_id, frame.message_id) for frame in flight.frames)
    wanted: dict[tuple[int, int], float] = defaultdict(float)
    for stream in STREAMS:
        wanted[(stream.component, stream.message_id)] += stream.ground_hz
    del wanted[(1, ORBIT_EXECUTION_STATUS)]  # there is no orbit in this flight
    del wanted[(PANDION, TOOL_CONTACT)]  # nor anything to touch
    del wanted[(PANDION, PAYLOAD_STATUS)]  # nor to grip
    for key, rate in wanted.items():
        # Slow streams may miss or gain one at the ends, and a mode change adds a heartbeat.
        slack = 3 if rate <= 2 else 1
        assert counts[key] == pytest.approx(rate * seconds, rel=0.10, abs=slack), key


def test_the_tlog_reads_with_mavutil(lockstep: Flight) -> None:
    reader = mavutil.mavlink_connection(str(lockstep.directory / "flight.tlog"))
    counts: Counter[int] = Counter()
    while (message := reader.recv_match()) is not None:
        counts[message.get_msgId()] += 1
    assert counts[30] == pytest.approx(150, rel=0.04)  # ATTITUDE, 50 Hz
    assert counts[0] >= 3
    assert counts[76] == 1  # what came from the ground station is in it as well


@pytest.mark.parametrize("mode", ["lockstep", pytest.param("realtime", marks=pytest.mark.long)])
def test_a_command_that_nobody_supports_is_answered(
    mode: str, request: pytest.FixtureRequest
) -> None:
    flight: Flight = request.getfixturevalue(mode)
    (ack,) = [frame.payload_values for frame in flight.frames if frame.message_id == 77]
    assert ack == (31010, 3, 0, 0, 255, 190)


@pytest.mark.long
def test_real_time_is_real_time(realtime: Flight) -> None:
    assert realtime.result["real_time_factor"] == pytest.approx(1.0, rel=0.02)
    assert realtime.result["completed"] is True


@pytest.fixture
def flying(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    process = start(
        "fly", "walls-calm", "--speed", "1", "--api", "none",
        "--gcs", f"udp:127.0.0.1:{free_port()}",
        "--duration", "5", "--out", str(tmp_path / "out"), cwd=tmp_path,
    )  # fmt: skip
    read_until(process, "flying")
    yield process
    clean_up(process)


@pytest.mark.parametrize(
    "ending", ["SIGINT to all", pytest.param("SIGTERM, fsw frozen", marks=pytest.mark.long)]
)
def test_a_signal_ends_everything_within_two_seconds_with_a_verdict(
    ending: str, flying: subprocess.Popen[str], tmp_path: Path
) -> None:
    frozen = ending == "SIGTERM, fsw frozen"
    if frozen:
        os.kill(pid_of_fsw(flying.pid), signal.SIGSTOP)
    begin = time.monotonic()
    if ending == "SIGINT to all":  # what a terminal does on Ctrl-C
        os.killpg(flying.pid, signal.SIGINT)
    else:
        flying.send_signal(signal.SIGTERM)
    reported, _ = flying.communicate(timeout=60)
    assert time.monotonic() - begin < 2.0
    assert flying.returncode == 1
    assert "FAIL" in reported
    assert "interrupted at step" in reported
    assert "Traceback" not in reported
    assert group_is_empty(flying.pid)
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["completed"] is False
    assert result["duration_s"] > 0.0
    assert frozen or result["mpc"]["p50_us"] > 0.0


@pytest.mark.drawn(1)
@pytest.mark.parametrize(
    ("pace", "to_all"),
    [
        (("--realtime",), False),
        (("--speed", "1"), True),  # what a terminal does on Ctrl-C: the vehicle ends first
        pytest.param(("--realtime",), True, marks=pytest.mark.long),
        pytest.param((), True, marks=pytest.mark.long),
    ],
)
def test_a_flight_without_an_end_is_ended_by_its_user(
    pace: tuple[str, ...], to_all: bool, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    process = start(
        "fly", "ground", *pace, "--gcs", f"udp:127.0.0.1:{free_port()}", "--api", "none",
        "--out", str(out), cwd=tmp_path,
    )  # fmt: skip
    try:
        read_until(process, "flying until interrupted")
        time.sleep(0.5)
        if to_all:
            os.killpg(process.pid, signal.SIGINT)
        else:
            process.send_signal(signal.SIGINT)
        reported, _ = process.communicate(timeout=60)
        assert process.returncode == 0, reported
        assert re.search(r"PASS interrupted at step \d+: ended by you$", reported, re.MULTILINE)
        result = json.loads((out / "result.json").read_text())
        assert (result["completed"], result["min_margin_m"]) == (True, None)
    finally:
        clean_up(process)


@pytest.mark.long
def test_children_die_with_a_killed_parent(tmp_path: Path) -> None:
    process = start("fly", "--api", "none", "--gcs", f"udp:127.0.0.1:{free_port()}", cwd=tmp_path)
    try:
        read_until(process, "preparing")  # which the flight software says: both are there
        process.kill()
        process.wait()
        assert group_is_empty(process.pid)
    finally:
        clean_up(process)


def test_a_reader_that_leaves_ends_the_flight_quietly(tmp_path: Path) -> None:
    process = start("fly", "--api", "none", "--gcs", f"udp:127.0.0.1:{free_port()}", cwd=tmp_path)
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.close()  # what `| head -1` does; standard error is in the same pipe
    assert process.wait(timeout=60) == 1
    assert group_is_empty(process.pid)


def test_a_crash_of_the_flight_software_is_one_sentence(
    flying: subprocess.Popen[str],
) -> None:
    os.kill(pid_of_fsw(flying.pid), signal.SIGKILL)
    reported, _ = flying.communicate(timeout=60)
    assert flying.returncode == 1
    assert "fsw ended with code -9" in reported
    assert "Traceback" not in reported
    assert group_is_empty(flying.pid)


def pid_of_fsw(leader: int) -> int:
    """The flight software in a process group."""
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(ProcessLookupError, FileNotFoundError):
            if entry.name.isdecimal() and os.getpgid(int(entry.name)) == leader:
                words = (entry / "cmdline").read_bytes().split(b"\0")
                if b"fsw" in words:
                    return int(entry.name)
    raise AssertionError("fsw does not run")
