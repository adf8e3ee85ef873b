"""One half stands still: both are gone in two seconds, and the end names the step."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from pathlib import Path

from tests.cli.command import clean_up, group_is_empty, read_until, start
from tests.processes.halves import free_port


def half_of(parent: int, module: str) -> int:
    """Process id of ``python -m module`` started by a process."""
    for entry in Path("/proc").iterdir():
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
            fields = (entry / "stat").read_text(encoding="ascii").rpartition(")")[2].split()
        except (OSError, NotADirectoryError):
            continue
        if int(fields[1]) == parent and module.encode() in words:
            return int(entry.name)
    raise AssertionError(f"no {module} under {parent}")


def flying(out: Path) -> subprocess.Popen[str]:
    gcs = f"--gcs=udp:127.0.0.1:{free_port()}"
    flight = ("fly", "walls-calm", "--speed", "1", "--duration", "8", "--api", "none")
    return start(*flight, gcs, "--out", str(out), cwd=out.parent)


def test_a_stall_of_either_half_ends_both(tmp_path: Path) -> None:
    """Two flights at once, because most of it is waiting."""
    flights = {stalled: flying(tmp_path / stalled) for stalled in ("sitl", "fsw")}
    try:
        for flight in flights.values():
            read_until(flight, "flying")
        begin_s = time.monotonic()
        for stalled, flight in flights.items():
            os.kill(half_of(flight.pid, stalled), signal.SIGSTOP)
        for flight in flights.values():
            assert flight.wait(timeout=20.0) == 1
            # Two seconds, and what starting to judge and to print may take on a busy machine.
            assert time.monotonic() - begin_s < 2.0 + 1.5
            assert group_is_empty(flight.pid)
            assert flight.stdout is not None
            said = flight.stdout.read()
            assert re.search(r"FAIL .*step \d+", said), said
    finally:
        for flight in flights.values():
            clean_up(flight)
