"""A flight as `pandion fly` flies it, to which a ground station listens."""

from __future__ import annotations

import json
import math
import socket
import subprocess
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from messages.frames import Frame, FrameWriter, split
from tests.cli.command import pandion

QUESTION = (0.0, *(math.nan,) * 6, 31010, 1, 1, 0)  # MAV_CMD_USER_1, which is not supported


class Listener:
    """A ground station that asks one question, and listens."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.1)
        self.address = f"udp:127.0.0.1:{self._socket.getsockname()[1]}"
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()
        self._socket.close()

    def _listen(self) -> None:
        while not self._closing.is_set():
            try:
                datagram, vehicle = self._socket.recvfrom(4096)
            except TimeoutError:
                continue
            if not self.frames:
                self._socket.sendto(FrameWriter(255, 190).frame(76, *QUESTION), vehicle)
            self.frames += split(datagram)


@dataclass
class Flight:
    """A flight that has ended."""

    done: subprocess.CompletedProcess[str]
    result: dict[str, Any]
    frames: list[Frame]
    directory: Path
    files: list[str] = field(default_factory=list)


def flown(cwd: Path, *arguments: str) -> Flight:
    listener = Listener()
    done = pandion(
        "fly", *arguments, "--api", "none", "--gcs", listener.address, "--json", "-", cwd=cwd
    )
    listener.close()
    assert done.returncode == 0, done.stderr
    (directory,) = (cwd / "runs").iterdir()
    files = sorted(path.name for path in directory.iterdir())
    return Flight(done, json.loads(done.stdout), listener.frames, directory, files)
