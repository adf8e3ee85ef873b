"""One half stands still or is gone: both are gone in two seconds, and the end names the step."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from functools import partial
from pathlib import Path

import pytest

from tests.cli.command import clean_up, group_is_empty, read_until, start
from tests.processes.both_processes import free_port
from tests.waiting import LostTime

PROMISED_S = 2.0  # from the stall to the end of `pandion fly`, result included
TRIES = 3  # a tenth of a second before the end is hard to hit


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


def flying(out: Path, *options: str, duration: str = "8") -> subprocess.Popen[str]:
    """A flight of which the first line of progress is there."""
    gcs = f"--gcs=udp:127.0.0.1:{free_port()}"
    flight = start(
        "fly", "walls-calm", *options, "--duration", duration, "--api", "none", gcs,
        "--out", str(out), cwd=out.parent,
    )  # fmt: skip
    read_until(flight, "flying")
    return flight


def end_of(flight: subprocess.Popen[str], half: str, number: signal.Signals) -> tuple[float, str]:
    """Send a signal to a process; returns the seconds until nothing runs, and the output."""
    with LostTime() as lost:
        begin_s = time.monotonic()
        os.kill(half_of(flight.pid, half), number)
        assert flight.wait(timeout=60.0) == 1
        took_s = time.monotonic() - begin_s
    took_s -= 2.0 * lost.seconds  # two of our processes end one after the other, and lose it both
    assert group_is_empty(flight.pid)
    assert flight.stdout is not None
    return took_s, flight.stdout.read()


in_long = partial(pytest.param, marks=pytest.mark.long)
NOT_ANSWERED = r"FAIL the flight software did not answer step \d{3,} .*; fsw did not end"
KILLED = r"FAIL fsw ended with code -9.*step \d{3,}"
# In real time the motors stop after a second without a command, and the simulator ends.
SILENT = r"the flight software sent nothing for 1\.2 s after step \d{3,}"
NOT_SENT = r"FAIL fsw: the simulator sent nothing for .* after step \d{3,}; sitl did not end"


@pytest.mark.long
@pytest.mark.parametrize(
    ("pace", "half", "number", "sentence"),
    [
        (("--speed", "1"), "fsw", signal.SIGSTOP, NOT_ANSWERED),
        in_long(("--speed", "1"), "sitl", signal.SIGSTOP, NOT_SENT),
        in_long(("--speed", "1"), "fsw", signal.SIGKILL, KILLED),
        in_long(("--realtime",), "fsw", signal.SIGSTOP, rf"FAIL {SILENT}; fsw did not end"),
        in_long(
            ("--realtime",), "fsw", signal.SIGKILL, rf"FAIL fsw ended with code -9.*; {SILENT}"
        ),
        in_long(("--realtime",), "sitl", signal.SIGSTOP, NOT_SENT),
    ],
)
def test_a_stall_of_a_half_ends_both_in_time_and_names_the_step(
    pace: tuple[str, ...], half: str, number: signal.Signals, sentence: str, tmp_path: Path
) -> None:
    flight = flying(tmp_path / "out", *pace)
    try:
        took_s, reported = end_of(flight, half, number)
    finally:
        clean_up(flight)
    assert re.search(sentence, reported), reported
    assert "Traceback" not in reported
    assert took_s <= PROMISED_S


@pytest.mark.long
def test_a_stall_shortly_before_the_end_is_no_pass(tmp_path: Path) -> None:
    """The simulator ends as planned, and the flight software has to be killed."""
    silent_s, reported = 0.0, ""
    for attempt in range(TRIES):
        out = tmp_path / f"{attempt}"
        flight = flying(out, "--realtime", duration="2")
        try:
            assert flight.stdout is not None
            for line in flight.stdout:
                if float(line.split()[1]) >= 1.7:  # of progress; too late for a fall to end it
                    break
            _, reported = end_of(flight, "fsw", signal.SIGSTOP)
        finally:
            clean_up(flight)
        assert re.search(r"FAIL flew 2\.0 s; (.*; )?fsw did not end by itself", reported), reported
        assert not (out / "fsw.json").exists()
        since = re.search(r"silent since step (\d{3}); fsw", reported)
        if since is not None:  # a slow machine is slow to stop it, and a tenth of a second is short
            silent_s = 2.0 - 0.002 * int(since[1])
            break
    assert 0.1 < silent_s < 0.4, reported
