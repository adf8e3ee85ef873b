"""A whole flight whose ground station is at the other end of a serial line."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path

import pytest

from messages.frames import FrameWriter, Losses
from messages.stream_reader import StreamReader
from tests.serial_line import SerialLine

HEARTBEAT, COMMAND_LONG, COMMAND_ACK, ATTITUDE = 0, 76, 77, 30
BAUD = 57_600


def flight(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pandion", "fly", "ground", "--api", "none", *words]
    return subprocess.run(
        [*command, "--duration", "2.5", "--realtime", "--out", str(folder)],
        capture_output=True,
        text=True,
        timeout=120.0,
    )


@pytest.mark.long
def test_a_station_on_a_noisy_serial_line_hears_and_is_heard(tmp_path: Path) -> None:
    station = FrameWriter(255, 190)
    asked = (512.0, *(0.0,) * 6, 512, 1, 1, 0)  # a message that does not exist
    with closing(SerialLine(BAUD, error_rate=1e-4)) as line:
        over = threading.Event()

        def speak() -> None:
            while not over.wait(0.1):
                line.send(station.frame(HEARTBEAT, 0, 6, 8, 0, 4, 3))
                line.send(station.frame(COMMAND_LONG, *asked))

        speaker = threading.Thread(target=speak)
        speaker.start()
        try:
            done = flight(tmp_path, "--gcs", f"serial:{line.device}:{BAUD}")
        finally:
            over.set()
            speaker.join()
        stream = line.take()
    assert done.returncode == 0, done.stderr
    reader, losses = StreamReader(), Losses()
    heard = [frame.message_id for frame, _ in reader.cut(stream, losses)]
    assert {HEARTBEAT, ATTITUDE, COMMAND_ACK} <= set(heard)
    link = json.loads((tmp_path / "fsw.json").read_text())["links"]["gcs"]
    assert link["connected"] is True
    assert link["connections"] == 1
    assert link["frames_accepted"] > 20


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("serial:/dev/ttyUSB0:12", "baud 12 is outside 9600..4000000"),
        ("tcp:127.0.0.1", "is not of the form udp:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or"),
        pytest.param(  # which the flight finds once it has begun
            "tcpin:192.0.2.1:5760",
            "cannot listen on tcpin:192.0.2.1:5760",
            marks=pytest.mark.long,
        ),
    ],
)
def test_an_address_of_no_use_is_refused_in_one_sentence(
    address: str, why: str, tmp_path: Path
) -> None:
    done = flight(tmp_path, "--gcs", address)
    assert done.returncode == 2
    assert why in done.stderr
    assert "Traceback" not in done.stderr


def test_two_links_cannot_share_a_line(tmp_path: Path) -> None:
    gcs, api = "serial:/dev/ttyUSB0:57600", "serial:/dev/ttyUSB0:115200"
    done = flight(tmp_path, "--gcs", gcs, "--api", api)
    assert done.returncode == 2
    assert "give them different ports or lines" in done.stderr
