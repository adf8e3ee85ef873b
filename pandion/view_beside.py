"""The live page beside a flight: a process of its own, which the flight does not wait for."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Final

from pandion.child import die_with
from pandion.display import Display

PORT: Final = 8042  # of the page, if it is free
_GRACE_S: Final = 3.0


class ViewBeside:
    """Started when the vehicle can be reached, ended with the flight."""

    def __init__(self, display: Display, out: Path, airframe: str) -> None:
        """Prepare for a flight whose files are in ``out``; ``display`` is told the address.

        It is one of a vehicle by the name or path ``airframe``.
        """
        self._display, self._out, self._airframe = display, out, airframe
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, vehicle_port: int) -> None:
        """Serve the page of the vehicle at a port of this machine."""
        page = _free_port()
        with (self._out / "view.log").open("wb") as log:
            self._process = subprocess.Popen(
                [
                    *(sys.executable, "-P", "-m", "pandion", "view"),
                    *("--vehicle", f"udp:127.0.0.1:{vehicle_port}", "--port", str(page)),
                    *("--airframe", self._airframe),
                ],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,  # Ctrl-C is for the flight, which ends it
                preexec_fn=die_with(os.getpid(), None),
            )
        threading.Thread(target=self._tell, args=(page,), daemon=True).start()

    def _tell(self, page: int) -> None:
        """Say where the page is, once it is served: loading what serves it takes seconds."""
        process = self._process
        while process is not None and process.poll() is None:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", page), 1.0):
                self._display.say(f"view: open http://127.0.0.1:{page}")
                return
            time.sleep(0.1)

    def close(self) -> None:
        """End it; safe to call without a start."""
        if self._process is None:
            return
        if self._process.poll() is not None:
            self._display.say(f"the view ended by itself; see {self._out / 'view.log'}")
        with contextlib.suppress(ProcessLookupError):
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None


def _free_port() -> int:
    """The usual one, or any."""
    for port in (PORT, 0):
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", port))
            return int(probe.getsockname()[1])
    return PORT
