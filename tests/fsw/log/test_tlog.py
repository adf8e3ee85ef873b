"""The log is what pymavlink's tools read, even after a kill."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink import mavutil

from command_line.run_directory import new_run_directory
from fsw.log.flight_log import TlogWriter
from messages.frames import FrameWriter
from tests.waiting import wait_for

START_US = 1_700_000_000_000_000


def heartbeat(writer: FrameWriter) -> bytes:
    return writer.frame(0, 0, 2, 12, 0, 4, 3)


def test_mavutil_reads_every_frame_with_its_time(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    log, writer = TlogWriter(path, START_US), FrameWriter(1, 1)
    for second in range(10):
        log.add(1_000_000 * second, heartbeat(writer))
    log.close()
    reader = mavutil.mavlink_connection(str(path))
    times = [reader.recv_match().__getattribute__("_timestamp") for _ in range(10)]
    assert times == pytest.approx([1.7e9 + second for second in range(10)])
    assert reader.recv_match() is None


def test_a_flight_is_never_written_over_another(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    TlogWriter(path, START_US).close()
    with pytest.raises(FileExistsError):
        TlogWriter(path, START_US)
    assert new_run_directory(tmp_path, "walls") == tmp_path / "walls-1"
    assert new_run_directory(tmp_path, "walls") == tmp_path / "walls-2"


KILLED = """
import sys, time
from pathlib import Path
from fsw.log.flight_log import TlogWriter
from messages.frames import FrameWriter
log, writer = TlogWriter(Path(sys.argv[1]), 1_700_000_000_000_000), FrameWriter(1, 1)
for tick in range(5000):
    log.add(2000 * tick, writer.frame(0, 0, 2, 12, 0, 4, 3))
print("written", flush=True)
time.sleep(60)
"""


def test_a_killed_process_leaves_whole_records(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "written\n"
    # At most the last half second of a flight of ten is lost.
    wait_for(lambda: path.stat().st_size >= 4750 * (8 + 21))
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    reader = mavutil.mavlink_connection(str(path))
    count = 0
    while reader.recv_match() is not None:
        count += 1
    assert count >= 4750
    assert path.stat().st_size % (8 + 21) == 0
