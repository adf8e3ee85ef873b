"""One half stands still: both are gone in two seconds, and the end names the step."""

from __future__ import annotations

import os
import re
import signal
import time
from pathlib import Path

import pytest

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


@pytest.mark.parametrize("stalled", ["sitl", "fsw"])
def test_a_stall_of_either_half_ends_both(stalled: str, tmp_path: Path) -> None:
    gcs = f"--gcs=udp:127.0.0.1:{free_port()}"
    flight = start(
        "fly", "walls-calm", "--lockstep", "--duration", "90", gcs, "--out", "x", cwd=tmp_path
    )
    try:
        read_until(flight, "flying")
        begin_s = time.monotonic()
        os.kill(half_of(flight.pid, stalled), signal.SIGSTOP)
        code = flight.wait(timeout=20.0)
        seconds = time.monotonic() - begin_s
        assert group_is_empty(flight.pid)
        assert flight.stdout is not None
        said = flight.stdout.read()
    finally:
        clean_up(flight)
    assert code == 1
    assert re.search(r"FAIL .*step \d+", said), said
    # Two seconds, and what starting to judge and to print may take on a busy machine.
    assert seconds < 2.0 + 1.5, seconds
