"""The planner's process is killed in real time: the flight goes on, and no barrier falls."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
from pathlib import Path

import pytest

from messages import dialect
from tests.processes.both_processes import SystemProcess
from tests.waiting import wait_for

STATUSTEXT = 253


def children(process: int) -> list[int]:
    """Direct children of a process."""
    text = Path(f"/proc/{process}/task/{process}/children").read_text()
    return [int(number) for number in text.split()]


def texts(ground: socket.socket) -> list[str]:
    """Status texts of the vehicle so far."""
    parser, reported = dialect.MAVLink(None), []
    parser.robust_parsing = True
    ground.setblocking(False)
    while True:
        try:
            datagram = ground.recv(4096)
        except BlockingIOError:
            return reported
        for message in parser.parse_buffer(datagram) or []:
            if message.get_type() == "STATUSTEXT":
                reported.append(message.text)


def planner_of(fsw: int, instead_of: int | None = None) -> tuple[int, int]:
    """The fork server and its worker, once a worker that is not ``instead_of`` is there."""

    def found() -> tuple[int, int] | None:
        with contextlib.suppress(ValueError, FileNotFoundError):
            (server,) = children(fsw)
            (worker,) = children(server)
            return None if worker == instead_of else (server, worker)
        return None

    both = wait_for(found, "a planner")
    assert both is not None
    return both


def fly_until(t_s: float, sitl: SystemProcess) -> None:
    """Wait for simulated time."""
    while sitl.wait_for("progress")["t_s"] < t_s:
        pass


@pytest.mark.requirement("REQ-PLAN-4")
@pytest.mark.long
def test_killing_the_planner_costs_no_barrier(tmp_path: Path) -> None:
    """The worker first, which the fork server replaces; later the fork server with its worker."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
        ground.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        ground.bind(("127.0.0.1", 0))
        flight = ("walls", "--realtime", "--seed", "2", "--duration", "6")
        with SystemProcess("sitl", *flight, "--listen", "udp:127.0.0.1:0") as sitl:
            port = sitl.wait_for("listening")["port"]
            addresses = ("--sim", f"udp:127.0.0.1:{port}")
            telemetry = ("--gcs", f"udp:127.0.0.1:{ground.getsockname()[1]}")
            with SystemProcess(
                "fsw", *addresses, *telemetry, "--out", str(tmp_path), "--wait", "90"
            ) as fsw:
                sitl.wait_for("flying", patience_s=120.0)
                fly_until(2.0, sitl)
                server, first = planner_of(fsw.process.pid)
                os.kill(first, signal.SIGKILL)
                fly_until(3.5, sitl)
                same, second = planner_of(fsw.process.pid, instead_of=first)
                assert same == server
                os.kill(server, signal.SIGKILL)
                ended = sitl.wait_for("ended", patience_s=30.0)
                assert fsw.finish() == 0
        reported = texts(ground)
    result, vehicle = ended["result"], json.loads((tmp_path / "fsw.json").read_text())
    assert result["completed"], result["end_reason"]
    assert min(result["margins_m"].values()) >= 0.0
    assert vehicle["mpc"]["restarts"] == 2
    assert vehicle["mpc"]["cycles"] > 40, "planned on with the new one"
    for what in ("planner process died", "planner processes died"):
        assert any(what in text for text in reported), reported
    for process in (server, first, second):
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)
