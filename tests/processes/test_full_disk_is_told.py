"""A log that the disk does not take is told to the station, as a text, an event and a bit."""

from __future__ import annotations

import resource
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from messages.frames import split
from tests.cli.command import PANDION, environment

SYS_STATUS, STATUSTEXT, EVENT = 1, 253, 410
LOGGING = 0x1000000  # MAV_SYS_STATUS
FAILSAFE = 1 << 24 | 10
MOST = 700_000  # bytes of a file; a flight of 8 s writes more


def no_long_files() -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (MOST, MOST))


@pytest.mark.requirement("REQ-LOG-1")
@pytest.mark.long
def test_a_flight_whose_log_ends_early_says_so_to_the_station(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(60.0)
        gcs = f"udp:127.0.0.1:{station.getsockname()[1]}"
        flight = subprocess.Popen(
            [
                *(*PANDION, "fly", "walls-calm", "--duration", "8", "--api", "none"),
                *("--gcs", gcs, "--out", str(tmp_path / "out")),
            ],
            stdout=subprocess.DEVNULL,
            env=environment(),
            preexec_fn=no_long_files,
        )
        text, events, written = "", set(), True
        while written or FAILSAFE not in events or "flight log damaged" not in text:
            for frame in split(station.recv(4096)):
                if frame.message_id == STATUSTEXT:
                    part = frame.payload_values[1]
                    text += part.decode() if isinstance(part, bytes) else ""
                elif frame.message_id == EVENT:
                    events.add(frame.payload_values[0])
                elif frame.message_id == SYS_STATUS:
                    written = bool(int(frame.payload_values[2]) & LOGGING)
        assert "flight.ulg ends early: File to" in text
        assert flight.wait(60.0) in (0, 1)
