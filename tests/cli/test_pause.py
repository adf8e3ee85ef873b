"""A process, or all of them, stopped for a while and sent on: the flight goes on as well."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path

import pytest

from tests.cli.command import clean_up
from tests.cli.test_stall import flying, half_of


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
