"""Both processes over real UDP: what is on the wire, and what a bad network changes."""

from __future__ import annotations

import contextlib
import re
import signal
import time
from collections import Counter
from pathlib import Path

import pytest

from messages import dialect
from tests.processes.both_processes import (
    Capture,
    Misbehaviour,
    SystemProcess,
    fly_through,
    free_port,
)

FLIGHT = ("--duration", "1.6", "--seed", "3")


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return fly_through(Misbehaviour(), tmp_path_factory.mktemp("clean"), *FLIGHT)


def decoded(datagram: bytes) -> list[dialect.MAVLink_message]:
    """Every message of a datagram as pymavlink reads it; a bad byte raises."""
    parser = dialect.MAVLink(None)
    parser.robust_parsing = False
    return list(parser.parse_buffer(bytearray(datagram)) or [])


def test_the_flight_completes_and_both_end_well(clean: Capture) -> None:
    assert (clean.sitl_exit, clean.fsw_exit) == (0, 0)
    assert clean.result["completed"]
    assert clean.result["steps"] == 800
    assert clean.fsw_json["end"] == "shutdown"
    assert clean.fsw_json["inner"]["ticks"] == 800


def test_the_capture_decodes_entirely_with_pymavlink(clean: Capture) -> None:
    seen: Counter[tuple[int, str]] = Counter()
    for datagram in clean.to_fsw + clean.to_sitl:
        messages = decoded(datagram)
        assert sum(len(message.get_msgbuf()) for message in messages) == len(datagram)
        assert len(datagram) < 1400
        seen.update((message.get_srcComponent(), message.get_type()) for message in messages)
    assert seen[(200, "HIL_SENSOR")] == 800
    assert seen[(1, "HIL_ACTUATOR_CONTROLS")] == 800
    assert seen[(195, "OBSTACLE_SHAPE")] == 6  # three walls, at once and again after a second
    assert seen[(195, "END_EFFECTOR_TARGET")] >= 31
    assert {name for _, name in seen} == {
        "HEARTBEAT", "ODOMETRY", "ARM_JOINT_STATE", "HIL_SENSOR", "HIL_ACTUATOR_CONTROLS",
        "OBSTACLE_SHAPE", "END_EFFECTOR_TARGET", "COMMAND_LONG", "COMMAND_ACK", "STATUSTEXT",
    } - ({"STATUSTEXT"} - {name for _, name in seen})  # fmt: skip


def test_the_barrier_is_the_last_message_of_each_step(clean: Capture) -> None:
    for datagram in clean.to_fsw:
        messages = decoded(datagram)
        names = [message.get_type() for message in messages]
        if "HIL_SENSOR" in names:
            assert names[-1] == "HIL_SENSOR"
            stamps = {m.time_usec for m in messages if m.get_srcComponent() == 200 and
                      m.get_type() != "HEARTBEAT"}  # fmt: skip
            assert len(stamps) == 1


@pytest.mark.long
def test_neither_a_bad_network_nor_speed_changes_the_flight(clean: Capture, tmp_path: Path) -> None:
    network = Misbehaviour(lost=0.004, doubled=0.2, late=0.003)
    bad = fly_through(network, tmp_path, *FLIGHT, "--speed", "2")
    assert bad.dropped > 0
    assert bad.result["resent_steps"] > 0
    assert bad.fsw_json["retransmissions"] > 0
    assert (bad.sitl_exit, bad.fsw_exit) == (0, 0)
    assert bad.fsw_json["inner"]["ticks"] == 800
    assert bad.actuators() == clean.actuators()
    assert bad.result["tracking_error_rms_m"] == clean.result["tracking_error_rms_m"]


@pytest.mark.long
def test_a_stall_of_one_half_ends_the_other_naming_the_step(tmp_path: Path) -> None:
    arguments = ("--listen", "udp:127.0.0.1:0", "--speed", "1", "--duration", "60")
    with contextlib.ExitStack() as processes:
        pairs = []
        for stalled in ("fsw", "sitl"):
            sitl = processes.enter_context(SystemProcess("sitl", "walls-calm", *arguments))
            sim = f"udp:127.0.0.1:{sitl.wait_for('listening')['port']}"
            gcs, out = f"udp:127.0.0.1:{free_port()}", str(tmp_path / stalled)
            fsw = processes.enter_context(
                SystemProcess("fsw", "--sim", sim, "--gcs", gcs, "--out", out)
            )
            pairs.append((fsw, sitl) if stalled == "fsw" else (sitl, fsw))
        for pair in pairs:
            next(half for half in pair if half.name == "sitl").wait_for("progress")
        begin = time.monotonic()
        for stalled_half, _ in pairs:
            stalled_half.signal(signal.SIGSTOP)
        for _, other in pairs:
            ended = other.wait_for("ended")
            assert other.finish() == 1
            assert 1.1 < time.monotonic() - begin < 2.5
            assert re.search(r"step \d+", ended["message"])
            assert "1.2 s" in ended["message"]


@pytest.mark.long
def test_an_interrupt_ends_a_simulator_that_waits() -> None:
    with SystemProcess("sitl", "--listen", "udp:127.0.0.1:0") as sitl:
        sitl.wait_for("ready")
        begin = time.monotonic()
        sitl.signal(signal.SIGINT)
        assert sitl.finish() == 1
        assert time.monotonic() - begin < 2.0
