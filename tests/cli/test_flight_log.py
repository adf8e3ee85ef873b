"""`pandion fly` leaves a log that repeats to the byte, flies again and exports."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader
from pyulog import ULog

from sitl.scenario_file import PACKAGED
from tests.cli.command import clean_up, one_sentence, pandion, pandion_here, read_until, start
from tests.cli.heard_flight import Flight
from tests.processes.both_processes import free_port
from tests.waiting import wait_for

FLIGHT = ("fly", "walls", "--lockstep", "--seed", "5", "--duration", "2")
TICKS = 1500  # of the log


@contextlib.contextmanager
def busy_machine() -> Iterator[None]:
    """As many idle-looping processes as there are processors."""
    hogs = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"])
        for _ in range(os.cpu_count() or 1)
    ]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


@pytest.fixture
def log(lockstep: Flight) -> Path:
    return lockstep.directory / "flight.ulg"


@pytest.mark.long
def test_the_same_seed_is_the_same_file_at_any_speed_on_a_busy_machine(tmp_path: Path) -> None:
    gcs = f"--gcs=udp:127.0.0.1:{free_port()}"
    done = pandion(*FLIGHT, gcs, "--out", "one", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    flight = start(*FLIGHT, gcs, "--out", "two", "--speed", "1", cwd=tmp_path)
    try:
        read_until(flight, "flying")  # to start in time is not the point
        with busy_machine():
            assert flight.wait(timeout=60.0) == 0
    finally:
        clean_up(flight)
    one, two = (tmp_path / name / "flight.ulg" for name in ("one", "two"))
    assert two.read_bytes() == one.read_bytes()


def test_it_says_what_was_flown_and_holds_every_tick_and_the_truth(log: Path) -> None:
    read = ULog(str(log))
    assert not read.file_corruption
    facts = read.msg_info_dict
    assert (facts["scenario"], facts["seed"], facts["pacing"]) == ("walls", 2, "lockstep")
    content = (PACKAGED / "walls.toml").read_bytes()
    assert facts["scenario_digest"] == hashlib.sha256(content).hexdigest()[:12]
    assert facts["ver_sw"]
    assert read.initial_parameters["planner.horizon"] == 5
    assert len(read.initial_parameters) > 200
    for name in ("sensor_frame", "actuator_command"):
        times = read.get_dataset(name).data["timestamp"]
        assert times.tolist() == [1_000_000 + 2000 * k for k in range(TICKS)], name
    for name in ("vehicle_attitude", "vehicle_local_position", "actuator_motors",
                 "arm_joint_state", "sim_ground_truth"):  # fmt: skip
        times = read.get_dataset(name).data["timestamp"]
        assert times.tolist() == [1_000_000 + 20_000 * k for k in range(TICKS // 10)], name
    for name in ("mpc_status", "barrier_margin", "vehicle_status", "loop_timing", "sim_tracking"):
        assert len(read.get_dataset(name).data["timestamp"]) >= 1, name
    estimate = read.get_dataset("vehicle_local_position").data
    truth = read.get_dataset("sim_ground_truth").data
    assert abs(truth["p_WB[2]"] - estimate["z"]).max() < 0.01
    assert not (log.parent / "truth.ulg").exists()


@pytest.mark.long
def test_with_the_full_profile_it_holds_everything_every_tick(tmp_path: Path) -> None:
    (tmp_path / "full.params").write_text("LOG_PROFILE 1\n")
    out = tmp_path / "full"
    flown = pandion("fly", "walls", "--duration=1", "--params=full.params", f"--out={out}",
                    cwd=tmp_path)  # fmt: skip
    assert flown.returncode == 0, flown.stderr
    read = ULog(str(out / "flight.ulg"))
    for name in ("vehicle_attitude", "arm_joint_state", "sim_ground_truth"):
        assert len(read.get_dataset(name).data["timestamp"]) == 500, name
    done = pandion("replay", str(out), "--verify", cwd=tmp_path)
    assert "no difference in 500 ticks" in done.stdout + done.stderr


def test_nothing_in_it_was_measured_by_the_wall_clock(log: Path) -> None:
    read = ULog(str(log))
    timing = read.get_dataset("loop_timing").data
    assert (timing["execution_p50_us"] != timing["execution_p50_us"]).all()  # NaN
    assert set(timing["late_ticks"]) == {0}
    solved = read.get_dataset("mpc_status").data["total_us"]
    assert (solved != solved).all()


def test_replay_finds_no_difference_and_says_so_in_json(log: Path, tmp_path: Path) -> None:
    done = pandion("replay", str(log.parent), "--verify", "--json", "-", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    unmade = found.pop("not_compared")
    assert {"ver_sw", "seed", "loop_timing", "sim_ground_truth"} <= {*unmade}
    assert not {"vehicle_attitude", "numbers", "profile"} & {*unmade}
    assert found == {
        "log": str(log), "same": True, "ticks": TICKS, "difference": None, "lost_ms": 0,
        "whole": True, "other_numbers": [], "other_definitions": [],
    }  # fmt: skip
    assert f"no difference in {TICKS} ticks" in done.stderr


@pytest.mark.long
def test_replay_names_the_first_difference(log: Path, tmp_path: Path) -> None:
    data = bytearray(log.read_bytes())
    at = data.rindex(b"hold to trajectory")
    data[at : at + 4] = b"HOLD"
    (tmp_path / "flight.ulg").write_bytes(data)
    done = pandion("replay", str(tmp_path), "--verify", cwd=tmp_path)
    assert done.returncode == 1
    (line,) = done.stdout.splitlines()
    assert line.startswith("first difference at tick ")
    assert line.endswith(
        ": text was 'HOLD to trajectory: command' and is 'hold to trajectory: command'"
    )


def test_without_verify_replay_shows_what_is_there(log: Path, tmp_path: Path) -> None:
    done = pandion_here("replay", str(log), cwd=tmp_path)
    assert done.returncode == 0
    for word in ("walls", "lockstep", "sensor_frame", str(TICKS), "hold to trajectory"):
        assert word in done.stdout


@pytest.mark.long
def test_a_flight_killed_in_real_time_is_readable_and_replays(tmp_path: Path) -> None:
    gcs = f"--gcs=udp:127.0.0.1:{free_port()}"
    flight = start(
        "fly", "walls", "--realtime", "--seed", "5", gcs, "--out", "killed", cwd=tmp_path
    )
    path = tmp_path / "killed" / "flight.ulg"
    try:
        wait_for(lambda: path.exists() and path.stat().st_size > 300_000, "a log", 60.0)
        os.killpg(flight.pid, signal.SIGKILL)
    finally:
        clean_up(flight)
    read = ULog(str(path))
    assert not read.file_corruption
    assert read.msg_info_dict["pacing"] == "realtime"
    assert (read.get_dataset("mpc_status").data["total_us"][1:] > 0.0).all()
    done = pandion("replay", str(path), "--verify", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "no difference in" in done.stdout


def test_export_to_csv_has_a_table_a_topic(log: Path, tmp_path: Path) -> None:
    done = pandion_here("export", str(log), "--csv", "tables", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with (tmp_path / "tables" / "actuator_command.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    read = ULog(str(log)).get_dataset("actuator_command").data
    assert [float(row["rotor_thrust[3]"]) for row in rows] == read["rotor_thrust[3]"].tolist()
    with (tmp_path / "tables" / "tick_input.csv").open(newline="") as file:
        inputs = list(csv.DictReader(file))
    plans = [json.loads(row["text"]) for row in inputs if row["field"] == "plan"]
    assert sum(plan is not None and "Plan" in plan for plan in plans) >= 15
    assert "hold to trajectory" in (tmp_path / "tables" / "texts.csv").read_text()


def test_export_to_mcap_reads_with_its_own_library(log: Path, tmp_path: Path) -> None:
    done = pandion_here("export", str(log), "--mcap", "flight.mcap", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with (tmp_path / "flight.mcap").open("rb") as file:
        reader = make_reader(file)
        found = [
            (message.log_time, json.loads(message.data))
            for _, _, message in reader.iter_messages(topics=["arm_joint_state"])
        ]
    read = ULog(str(log)).get_dataset("arm_joint_state").data
    assert [time_ns for time_ns, _ in found] == [1000 * int(t) for t in read["timestamp"]]
    assert [values["q"][1] for _, values in found] == read["q[1]"].tolist()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("replay", "nowhere.ulg"), "cannot read nowhere.ulg: No such file"),
        (("replay", "text.ulg", "--verify"), "text.ulg is not a ULog file"),
        (("export", "text.ulg", "--csv", "x"), "text.ulg is not a ULog file"),
        (("replay", "text.ulg", "--json", "no/where"), "cannot write no/where"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_sentence(
    arguments: tuple[str, ...], words: str, tmp_path: Path
) -> None:
    (tmp_path / "text.ulg").write_text("this is a text, and no log")
    done = pandion_here(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert one_sentence(done.stderr)
    assert words in done.stderr
