"""A ground station takes the vehicle off the scenario's trajectory: two processes, real sockets."""

from __future__ import annotations

import math
import socket
from pathlib import Path

import pytest

from messages.frames import FrameWriter, split
from tests.processes.both_processes import SystemProcess

HEARTBEAT, COMMAND_LONG, COMMAND_ACK, STATUSTEXT = 0, 76, 77, 253
SET_MODE, TRAJECTORY, HOLD = 176, 4 << 16 | 11 << 24, 4 << 16 | 3 << 24
NAN = math.nan


@pytest.mark.long
def test_the_verdict_says_that_the_trajectory_was_left_and_for_what(tmp_path: Path) -> None:
    station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    station.bind(("127.0.0.1", 0))
    station.settimeout(60.0)
    writer = FrameWriter(255, 190)
    modes, acks = [], []
    with SystemProcess(
        "sitl", "walls-calm", "--listen", "udp:127.0.0.1:0", "--duration", "6"
    ) as sitl:
        sim = f"udp:127.0.0.1:{sitl.wait_for('listening')['port']}"
        gcs = f"udp:127.0.0.1:{station.getsockname()[1]}"
        out = ("--api", "none", "--out", str(tmp_path / "out"))
        with SystemProcess("fsw", "--sim", sim, "--gcs", gcs, *out) as fsw:
            while not (TRAJECTORY in modes and modes[-1] == HOLD):
                datagram, vehicle = station.recvfrom(4096)
                for frame in split(datagram):
                    if frame.message_id == HEARTBEAT:
                        modes.append(frame.payload_values[0])
                        if modes[-1] == TRAJECTORY:
                            hold = (1.0, 4.0, 3.0, NAN, NAN, NAN, NAN, SET_MODE, 1, 1, 0)
                            station.sendto(writer.frame(COMMAND_LONG, *hold), vehicle)
                    elif frame.message_id == COMMAND_ACK:
                        acks.append(frame.payload_values)
            result = sitl.wait_for("ended", patience_s=60.0)["result"]
            assert (sitl.finish(), fsw.finish()) == (1, 0)
    station.close()
    assert (SET_MODE, 0, 0, 0, 255, 190) in acks
    assert result["completed"] is False
    assert "the vehicle left the trajectory for hold at" in result["end_reason"]
    assert result["min_margin_m"] > 0.0
