"""``pandion fsw --autopilot-link`` as a process, with the stand-in for PX4 at the other end."""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.cli.command import pandion_here
from tests.processes.test_px4_process import AIRFRAME
from tests.px4_companion_stand_in import OFFBOARD, Px4Companion

PLACE = (1.0, -2.0, -1.5)


def hovering() -> Px4Companion:
    px4 = Px4Companion(AIRFRAME)
    px4.airborne()
    px4.p, px4._last_us = np.array(PLACE), 20_000_000
    return px4


def speak(px4: Px4Companion, stream: socket.socket, seconds: float) -> None:
    """Let time pass, 4 ms at a time: PX4 says where it hovers, and hears what comes."""
    for _ in range(round(seconds / 0.004)):
        px4._last_us += 4000
        px4._speak(px4._last_us)
        stream.sendall(px4.said)
        px4.said = b""
        with contextlib.suppress(BlockingIOError):
            px4.hear_companion(stream.recv(65536, socket.MSG_DONTWAIT))
        time.sleep(0.004)


@pytest.mark.long
def test_it_streams_takes_over_gives_back_and_writes_what_it_found(tmp_path: Path) -> None:
    px4 = hovering()
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        command = [
            *(sys.executable, "-m", "pandion", "fsw", "--events", "json", "--out", str(tmp_path)),
            *("--autopilot-link", f"tcp:127.0.0.1:{port}", "--wait", "60"),
            *("--gcs", "udp:127.0.0.1:24551", "--api", "none"),
        ]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                server.settimeout(300.0)
                stream, _ = server.accept()
                speak(px4, stream, 3.0)
                assert px4.targets > 20
                assert px4.target is not None
                assert px4.target.p == pytest.approx(PLACE, abs=0.05)
                assert px4.switch(OFFBOARD)
                speak(px4, stream, 2.0)
                assert px4.mode == OFFBOARD
                assert px4.joints != (0.0, 0.0), "the arm is held where the plan has it"
                px4.switch((3, 0))
                speak(px4, stream, 1.0)
                process.send_signal(signal.SIGINT)
                said, _ = process.communicate(timeout=30.0)
            finally:
                process.kill()
    texts = [json.loads(line).get("message", "") for line in said.splitlines()]
    assert any("PX4 flies Position" in text for text in texts), texts
    found = json.loads((tmp_path / "fsw.json").read_text())
    assert found["px4"]["mode"] == "Position"
    assert found["px4"]["round_trip_ms"] < 1000.0


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--arm-link", "udp:127.0.0.1:24582"], "--arm-link is beside PX4; add --autopilot-link"),
        (["--autopilot-link", "14540"], "address '14540' is not of the form"),
        (
            ["--autopilot-link", "udp:127.0.0.1:24580", "--tracking", "pid"],
            "above PX4 the loops are PX4's",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(
    words: list[str], why: str, tmp_path: Path
) -> None:
    done = pandion_here("fsw", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert why in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_line_that_is_too_slow_for_the_estimate_is_refused(tmp_path: Path) -> None:
    done = pandion_here("fsw", "--autopilot-link", "serial:/dev/null:57600", cwd=tmp_path)
    assert done.returncode == 2
    assert "use 460800 baud or more" in done.stderr
