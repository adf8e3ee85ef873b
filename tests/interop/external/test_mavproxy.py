"""MAVProxy as ground station, at its prompt; run by ``make interop``."""

from __future__ import annotations

import os
import re
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from fsw.autopilot.parameters.registry import PARAMETERS
from messages.export import write_definitions
from tests.interop.external.environments import environment_of, only_where_installed
from tests.interop.mavsdk_client import eventually
from tests.interop.vehicle import REAL_TIME, Vehicle
from tests.parameters_on_the_wire import LISTED

PACING = REAL_TIME
pytestmark = only_where_installed


class Prompt:
    """A running MAVProxy."""

    def __init__(self, vehicle: Vehicle, home: Path) -> None:
        write_definitions(home / "definitions")
        program = environment_of("mavproxy") / "bin" / "mavproxy.py"
        self.home = home
        self._process = subprocess.Popen(
            [
                *(program, "--dialect=pandion", f"--master=udpin:127.0.0.1:{vehicle.gcs_port}"),
                f"--state-basedir={home}",
            ],
            env={
                **os.environ,
                "MDEF": str(home / "definitions"),
                "MAVLINK20": "1",
                "PYTHONUNBUFFERED": "1",
            },
            cwd=home,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._said = ""
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        while piece := os.read(self._process.stdout.fileno(), 4096):
            self._said += piece.decode(errors="replace")

    def says(self, words: str, patience_s: float = 20.0, command: str = "") -> re.Match[str]:
        """Type a command, and wait until words, a regular expression, appear behind it."""
        at = len(self._said)
        if command:
            assert self._process.stdin is not None
            self._process.stdin.write(f"{command}\n")
            self._process.stdin.flush()
        until = time.monotonic() + patience_s
        while (found := re.search(words, self._said[at:])) is None:
            assert time.monotonic() < until, f"no {words!r} in {self._said[at:]!r}"
            time.sleep(0.05)
        return found

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()


@pytest.fixture(scope="module")
def prompt(vehicle: Vehicle, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Prompt]:
    prompt = Prompt(vehicle, tmp_path_factory.mktemp("mavproxy"))
    yield prompt
    prompt.close()


def test_it_finds_the_vehicle_and_its_parameters(prompt: Prompt) -> None:
    prompt.says(f"Received {len(LISTED)} parameters", 60.0)


def test_it_reads_the_private_messages_and_takes_none_for_loss(prompt: Prompt) -> None:
    prompt.says("ARM_JOINT_STATE {", command="status ARM_JOINT_STATE")
    assert float(prompt.says(r"([\d.]+)% loss", command="link")[1]) < 1.0


def test_it_sets_a_parameter(prompt: Prompt) -> None:
    known = PARAMETERS[0]
    middle = 0.5 * (known.default + known.most)
    for name, values in ((known.name, (middle, known.default)), ("NAV_DLL_ACT", (3, 2))):
        for wanted in values:
            prompt.says("", command=f"param set {name} {wanted}")
            time.sleep(3.0)  # it repeats each second what was not answered, and says nothing
            prompt.says(rf"{name} +{wanted:.0f}", command=f"param show {name}")


def test_it_lists_and_fetches_files(prompt: Prompt, earlier: bytes) -> None:
    prompt.says("parameters.json", command="ftp list /")
    prompt.says(" D earlier", command="ftp list /logs")
    prompt.says("crc: /logs/earlier/flight.tlog 0x", command="ftp crc /logs/earlier/flight.tlog")
    prompt.says("Wrote", command="ftp get /logs/earlier/flight.tlog ftp.tlog")
    assert eventually(lambda: (prompt.home / "ftp.tlog").read_bytes() == earlier)


def test_it_downloads_a_log(prompt: Prompt, earlier: bytes) -> None:
    prompt.says("Log 0  numLogs 2", command="log list")

    def downloaded() -> bool:
        prompt.says("Finished downloading", command="log download 0 log.tlog")
        return eventually(lambda: (prompt.home / "log.tlog").read_bytes() == earlier, 3.0)

    # The answer without data is the end to it though it misses blocks that a busy machine lost.
    assert any(downloaded() for _ in range(3))


def test_it_loads_a_mission(prompt: Prompt) -> None:
    home = prompt.says(r"latitude : (-?\d+), longitude : (-?\d+)", command="status HOME_POSITION")
    north, east = int(home[1]) * 1e-7, int(home[2]) * 1e-7
    lines = ["QGC WPL 110", f"0 1 0 16 0 0 0 0 {north} {east} 0 1"]
    for number, height in ((1, 1.5), (2, 2.0)):
        lines.append(f"{number} 0 3 16 0 0 0 0 {north + 5e-6} {east} {height} 1")
    (prompt.home / "points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    prompt.says(r"(?s)Loaded 3 waypoints.*Sent all 3 waypoints", command="wp load points.txt")
    prompt.says("Saved 3 waypoints", command="wp save back.txt")


def test_it_flies(prompt: Prompt) -> None:
    prompt.says("ARMED", command="arm throttle")
    prompt.says("takeoff to hold", command="takeoff 1.2")
    prompt.says("required argument is not a float", command="mode LAND")  # of MAVProxy's own
    prompt.says("Mode LAND", command="long DO_SET_MODE 129 4 6")
    prompt.says("DISARMED", 40.0)
