"""A vehicle on the ground as a process, with links on ports of its own."""

from __future__ import annotations

import contextlib
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.cli.command import PANDION, environment
from tests.processes.both_processes import free_port

# The client's clock is the wall's, the vehicle's is the simulator's and four times as fast. A busy
# machine makes it slow, where real time would make it late.
FAST = ("--lockstep", "--speed", "4")
# By the vehicle's clock: of the client's the usual half a second would be an eighth, for which one
# that sends setpoints 20 times a second may have to wait for the machine.
PATIENT = {"COM_OF_LOSS_T": 5.0}
REAL_TIME = ("--realtime",)
START_S = 240.0  # the first start compiles
FAREWELL_S = 20.0


@dataclass(frozen=True)
class Vehicle:
    """Where to find it."""

    gcs_port: int  # where it expects a ground station
    api_port: int  # where it expects a program
    out: Path  # its logs

    @property
    def log(self) -> Path:
        """The log of this flight that is offered for download."""
        ulog = self.out / "flight.ulg"
        return ulog if ulog.exists() else self.out / "flight.tlog"

    @property
    def reported(self) -> Path:
        """What it has reported on its console."""
        return self.out.parent / "reported.txt"


def parameter_file(folder: Path) -> Path:
    """Where a vehicle with its logs in ``folder`` keeps its parameters: what marks its flights."""
    return folder.resolve() / "vehicle.params"


@contextlib.contextmanager
def standing_vehicle(folder: Path, *pacing: str) -> Iterator[Vehicle]:
    """``pandion fly ground``, until the block ends.

    Args:
        folder: For the logs and parameters; earlier flights may lie there.
        *pacing: Options such as ``--realtime``.
    """
    vehicle = Vehicle(free_port(), free_port(), folder / "present")
    reported, parameters = vehicle.reported, parameter_file(folder)
    if pacing == FAST:
        lines = [f"1\t1\t{name}\t{value:g}\t9\n" for name, value in PATIENT.items()]
        parameters.write_text("# Pandion\n" + "".join(lines), encoding="ascii")
    command = [
        *(*PANDION, "fly", "ground", *pacing),
        f"--gcs=udp:127.0.0.1:{vehicle.gcs_port}",
        f"--api=udp:127.0.0.1:{vehicle.api_port}",
        f"--keys={folder / 'keys'}",
        f"--params={parameters}",
        f"--out={vehicle.out}",
    ]
    with reported.open("wb") as output:
        process = subprocess.Popen(
            command, env=environment(), stdout=output, stderr=subprocess.STDOUT
        )
    try:
        _wait_for_heartbeat(vehicle, process, reported)
        yield vehicle
        assert process.poll() is None, reported.read_text()
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(FAREWELL_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise


def _wait_for_heartbeat(vehicle: Vehicle, process: subprocess.Popen[bytes], reported: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", vehicle.gcs_port))
        station.settimeout(0.2)
        until = time.monotonic() + START_S
        while time.monotonic() < until:
            assert process.poll() is None, reported.read_text()
            with contextlib.suppress(TimeoutError):
                station.recv(2048)
                return
    raise AssertionError(f"no telemetry within {START_S:g} s: {reported.read_text()}")
