"""A log on a disk that is full, slow or cut off by a kill."""

from __future__ import annotations

import fcntl
import os
import random
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from pyulog import ULog

from fsw.autopilot.signals import SensorFrame, TickInputs
from fsw.log.flight_log import FlightLog, RunFiles
from messages.block_file import BlockFile
from pandion.logged_ticks import Gap, LoggedTick, open_flight, ticks
from tests.fsw.link.snapshots import outputs_at
from tests.fsw.log.specimens import inputs
from tests.replay.test_logged_ticks import SUBJECT
from tests.waiting import wait_for

_THREE = (0.5, 0.5, 0.5)
STILL = SensorFrame(0, _THREE, _THREE, (1.0, 0.0, 0.0, 0.0), _THREE, _THREE, (0.5,) * 2, (0.5,) * 2)


def write_ticks(log: FlightLog, count: int) -> None:
    dice = random.Random(1)
    for k in range(count):
        t_us = 1_000_000 + 2000 * k
        log.add(inputs(t_us, dice), outputs_at(t_us))


@pytest.fixture
def small_disk() -> Iterator[None]:
    """No file may grow beyond 200 kB; the system answers as a full disk does, with an error."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.long
@pytest.mark.requirement("REQ-LOG-1")
@pytest.mark.parametrize(
    "lockstep",
    [pytest.param(True, id="lockstep"), pytest.param(False, id="realtime")],
)
def test_a_full_disk_ends_the_files_and_is_told_once_a_file(
    lockstep: bool, tmp_path: Path, small_disk: None
) -> None:
    received: list[str] = []
    files = RunFiles(tmp_path, 0, SUBJECT, received.append)
    files.ulog.begin(1_000_000, lockstep)
    for _ in range(3):
        write_ticks(files.ulog, 300)
        for k in range(300):
            files.tlog.add(2_000 * k, bytes(1000))
        files.check()
    files.close()
    files.close()
    assert sorted(received) == [
        "flight.tlog ends early: File too large",
        "flight.ulg ends early: File too large",
    ]
    assert sorted(files.lost) == [
        f"{tmp_path / 'flight.tlog'}: File too large",
        f"{tmp_path / 'flight.ulg'}: File too large",
    ]
    reported = files.as_json()
    assert reported["flight.ulg"] == {
        "bytes": (tmp_path / "flight.ulg").stat().st_size,
        "dropped_blocks": 0,
        "failure": "File too large",
    }
    # What fitted is whole: the part of a block that went in was taken out again.
    log = open_flight(tmp_path / "flight.ulg")
    assert sum(isinstance(tick, LoggedTick) for tick in ticks(log)) > 10
    assert log.whole
    assert "cut" in log.cut


@pytest.mark.long
@pytest.mark.requirement("REQ-LOG-1")
def test_a_log_that_was_deleted_is_told_once_and_while_it_flies(tmp_path: Path) -> None:
    received: list[str] = []
    files = RunFiles(tmp_path, 0, SUBJECT, received.append)
    files.ulog.begin(1_000_000, lockstep=True)
    files.check()
    assert (files.failure(), received) == ("", [])
    (tmp_path / "flight.ulg").unlink()
    for _ in range(2):
        write_ticks(files.ulog, 300)
        files.check()
    assert files.failure() == "flight.ulg ends early: the file was deleted"
    (tmp_path / "flight.tlog").unlink()
    files.close()
    files.close()
    assert received == [
        "flight.ulg ends early: the file was deleted",
        "flight.tlog ends early: the file was deleted",
    ]


@pytest.mark.long
@pytest.mark.requirement("REQ-LOG-3")
def test_a_slow_disk_delays_no_tick_and_leaves_a_marked_gap(tmp_path: Path) -> None:
    disk_is_back = threading.Event()

    def stuck(file: int, block: memoryview) -> int:
        disk_is_back.wait(30.0)
        return os.write(file, block)

    log = FlightLog(tmp_path / "flight.ulg", SUBJECT)
    log.file = BlockFile(tmp_path / "slow.ulg", stuck)
    log.begin(1_000_000, lockstep=False)
    longest_s = 0.0
    for k in range(12_000):  # 24 s of sensor time: more than may wait
        t_us = 1_000_000 + 2000 * k
        begin_s = time.thread_time()
        log.add(TickInputs(replace(STILL, t_us=t_us)), outputs_at(t_us))
        longest_s = max(longest_s, time.thread_time() - begin_s)
        if k == 11_000:
            disk_is_back.set()
            wait_for(lambda: log.file.size > 0)
    log.close()
    assert longest_s < 0.01
    assert log.lost_us > 1_000_000
    assert log.file.dropped > 4
    found = list(ticks(open_flight(tmp_path / "slow.ulg")))
    (gap,) = [tick for tick in found if isinstance(tick, Gap)]
    assert gap.duration_ms == round(1e-3 * log.lost_us)
    whole = ULog(str(tmp_path / "slow.ulg"))
    assert [dropout.duration for dropout in whole.dropouts] == [gap.duration_ms]
    times = next(data for data in whole.data_list if data.name == "sensor_frame").data["timestamp"]
    assert len(times) == 12_000 - log.lost_us // 2000


KILLED = """
import sys, time
from pathlib import Path
from fsw.log.flight_log import FlightLog
from tests.fsw.log.test_disks import SUBJECT, write_ticks
for name in ("lockstep", "realtime"):
    log = FlightLog(Path(sys.argv[1]) / name, SUBJECT)
    log.begin(1_000_000, lockstep=name == "lockstep")
    write_ticks(log, 1000)
print("written", flush=True)
time.sleep(60)
"""


def ticks_in(path: Path) -> int:
    return sum(isinstance(tick, LoggedTick) for tick in ticks(open_flight(path)))


def is_locked(path: Path) -> bool:
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


@pytest.mark.requirement("REQ-LOG-4")
@pytest.mark.long
def test_a_killed_process_leaves_readable_logs(tmp_path: Path) -> None:
    paths = (tmp_path / "lockstep", tmp_path / "realtime")
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[3],
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "written\n"
    for path in paths:
        assert is_locked(path)
        wait_for(lambda path=path: ticks_in(path) >= 1000 - 130)  # type: ignore[misc]
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    for path in paths:
        assert not is_locked(path)
        log = ULog(str(path))
        assert not log.file_corruption
        count = len(log.get_dataset("sensor_frame").data["q_WB[0]"])
        assert count >= 1000 - 130  # at most the last quarter of a second of a flight is lost
        assert ticks_in(path) == count
