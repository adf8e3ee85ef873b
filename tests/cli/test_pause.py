"""A process, or all of them, stopped for a while and sent on: the flight goes on as well."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path

import pytest

from sitl.scenario_file import PACKAGED
from tests.cli.command import clean_up, start
from tests.cli.test_stall import flying, half_of
from tests.processes.both_processes import free_port


@pytest.mark.long
@pytest.mark.parametrize(
    ("pace", "processes", "pause_s"),
    [
        (("--realtime",), ("sitl",), 1.0),
        (("--realtime",), ("fsw", "sitl"), 3.0),  # what a laptop does whose lid is closed
        (("--speed", "2"), ("fsw",), 1.0),
        (("--speed", "2"), ("sitl",), 1.0),
    ],
)
def test_a_flight_survives_a_pause(
    pace: tuple[str, ...], processes: tuple[str, ...], pause_s: float, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    flight = flying(out, *pace, duration="3")
    try:
        stopped = [half_of(flight.pid, half) for half in processes]
        for process in stopped:
            os.kill(process, signal.SIGSTOP)
        time.sleep(pause_s)
        for process in stopped:
            os.kill(process, signal.SIGCONT)
        reported, _ = flight.communicate(timeout=30.0)
        assert flight.returncode == 0, reported
        assert "PASS flew 3.0 s" in reported
        simulator = json.loads((out / "sitl.json").read_text())
        if pace == ("--realtime",):
            assert simulator["pauses"] >= 1
            assert pause_s - 0.1 <= simulator["paused_s"] <= pause_s + 0.5
            assert "sitl: process was suspended" in reported
        else:
            assert simulator["pauses"] == 0
    finally:
        clean_up(flight)


@pytest.mark.long
@pytest.mark.parametrize(("at_s", "seed"), [(3.0, 1), (5.3, 2), (7.7, 3)])
def test_a_short_pause_of_the_flight_software_costs_no_contact(
    at_s: float, seed: int, tmp_path: Path
) -> None:
    """From which pause on a flight is lost stands in the safety manual."""
    scenario, out = tmp_path / "paused.toml", tmp_path / "out"
    fault = f'unit = "flight software"\nkind = "stopped"\nstart_s = {at_s}\nduration_s = 0.5\n'
    walls = (PACKAGED / "walls.toml").read_text(encoding="utf-8")
    scenario.write_text(f"{walls}\n[[faults]]\n{fault}", encoding="utf-8")
    flight = start(
        "fly", str(scenario), "--realtime", "--sensors", "mocap", "--seed", str(seed),
        "--duration", str(at_s + 5.0), "--api", "none", f"--gcs=udp:127.0.0.1:{free_port()}",
        "--out", str(out), cwd=tmp_path,
    )  # fmt: skip
    try:
        reported, _ = flight.communicate(timeout=120.0)
        result = json.loads((out / "result.json").read_text())
        assert f"flew {at_s + 5.0:.1f} s" in result["end_reason"], reported
        assert json.loads((out / "sitl.json").read_text())["missed_steps"] >= 220
        assert min(result["surfaces_m"].values()) > 0.0
    finally:
        clean_up(flight)
