"""``pandion sitl --for px4`` as a process, with the stand-in for PX4 at the other end."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.cli.command import pandion_here
from tests.px4_stand_in import Airframe, Connected, Px4StandIn, Wish
from vehicles.vehicle_file import load_vehicle

VEHICLE = load_vehicle("paper")
FRONT = VEHICLE.rotors[2]
AIRFRAME = Airframe(
    VEHICLE.mass, VEHICLE.base.inertia[:3], FRONT.position[0], FRONT.torque_per_thrust,
    FRONT.thrust_max,
)  # fmt: skip


@contextmanager
def simulator(*words: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "pandion", "sitl", *words, "--for", "px4"]
    with subprocess.Popen(
        [*command, "--listen", "tcp:127.0.0.1:0", "--events", "json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def until(process: subprocess.Popen[str], event: str) -> list[dict[str, Any]]:
    """Events up to the one of this name."""
    found: list[dict[str, Any]] = []
    assert process.stdout is not None
    for line in process.stdout:
        found.append(json.loads(line))
        if found[-1]["event"] == event:
            return found
    raise AssertionError(f"no {event}: {found}")


def test_a_scenario_in_the_air_is_flown_from_the_ground(tmp_path: Path) -> None:
    def operator(time_s: float) -> Wish:
        return Wish(armed=time_s > 0.2, place=(-0.9, 0.2, -1.0))

    with simulator("walls", "--duration", "4", "--out", str(tmp_path)) as process:
        begun = until(process, "ready")
        said = [event["message"] for event in begun]
        assert "sitl: sensors mocap: PX4 takes sensors without noise for stuck" in said
        assert "sitl: walls begins on the ground: PX4 takes off itself" in said
        port = next(event["port"] for event in begun if event["event"] == "listening")
        connected = Connected(Px4StandIn(AIRFRAME, operator), port)
        connected.start()
        flown = until(process, "ended")
        assert process.wait(10.0) == 0
    assert any(event["message"].startswith("sitl: PX4 answers from step ") for event in flown)
    result = json.loads((tmp_path / "sitl.json").read_text())
    assert result["end_reason"] == "flew 4.0 s"
    assert result["sensors"] == "mocap"
    assert result["min_margin_m"] > 0.0
    assert (tmp_path / "truth.ulg").stat().st_size > 10_000


@pytest.mark.long
def test_ctrl_c_ends_a_flight_without_a_duration(tmp_path: Path) -> None:
    with simulator("ground", "--speed", "1", "--out", str(tmp_path)) as process:
        port = until(process, "listening")[-1]["port"]
        until(process, "ready")
        connected = Connected(Px4StandIn(AIRFRAME), port)
        connected.start()
        until(process, "answering")
        process.send_signal(signal.SIGINT)
        until(process, "ended")
        assert process.wait(10.0) == 0
    assert "ended by you" in json.loads((tmp_path / "sitl.json").read_text())["end_reason"]


@pytest.mark.long
def test_a_px4_that_leaves_ends_the_flight_with_the_step() -> None:
    with simulator("ground", "--speed", "1") as process:
        port = until(process, "listening")[-1]["port"]
        until(process, "ready")
        connected = Connected(Px4StandIn(AIRFRAME), port)
        connected.start()
        until(process, "answering")
        connected.hang_up()
        assert "PX4 closed the connection at step" in until(process, "ended")[-1]["message"]
        assert process.wait(10.0) == 1


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--realtime"], "--for px4 is in lockstep with PX4; --speed 1 is real time"),
        (["--sensors", "perfect"], "--sensors perfect: PX4 takes sensors without noise for stuck"),
        (["--listen", "udp:127.0.0.1:4560"], "not of the form tcp:HOST:PORT"),
        (["--rate", "1000"], "'1000' is neither 250 nor 500"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(
    words: list[str], why: str, tmp_path: Path
) -> None:
    done = pandion_here("sitl", "ground", "--for", "px4", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert why in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_rate_without_px4_is_refused(tmp_path: Path) -> None:
    done = pandion_here("sitl", "ground", "--rate", "500", cwd=tmp_path)
    assert done.returncode == 2
    assert "--rate is of the exchange with PX4; add --for px4" in done.stderr
