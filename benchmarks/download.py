"""``python -m benchmarks download``: fetch a flight log in real time and judge the speed."""

from __future__ import annotations

import os
import random
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.download_client import DownloadClient, NothingCame
from benchmarks.machine_watch import version_and_machine
from benchmarks.two_processes import figures, fly
from command_line.options import json_file, option, read
from command_line.output import console_beside, json_text, print_error, write_text
from command_line.values import number
from fsw.link.files.vehicle_files import MARK
from pandion.display import Display
from pandion.supervisor import ProcessFailed

PASSED, NOT_PASSED = 0, 1  # exit codes
MIN_MB_PER_S: Final = 2.0
_CONNECT_S: Final = 60.0
_EARLIER: Final = "earlier"  # directory of the log that is fetched
_MB: Final = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class DownloadOptions:
    """One measurement."""

    json: str | None = json_file("the figures")
    size_mb: float = option("--size MB", "of the log", number(0.1, 1000.0, "MB"), default=20.0)


@dataclass(frozen=True, slots=True)
class Download:
    """One log, fetched one way."""

    way: str
    size: int  # bytes
    took_s: float
    identical: bool

    @property
    def mb_per_s(self) -> float:
        """Speed [MB/s]."""
        return self.size / self.took_s / _MB

    @property
    def passed(self) -> bool:
        """Whether every byte came, soon enough."""
        return self.identical and self.mb_per_s >= MIN_MB_PER_S


@dataclass(frozen=True, slots=True)
class Downloads:
    """What one flight gave."""

    downloads: tuple[Download, ...]
    logged_mb_per_s: float  # by the flight itself, meanwhile
    asked_again: int
    inner: dict[str, Any]  # of fsw.json

    @property
    def passed(self) -> bool:
        """Whether both ways came to an end and passed."""
        return len(self.downloads) == 2 and all(each.passed for each in self.downloads)


def main(argv: list[str]) -> int:
    """Measure and judge; returns the exit code."""
    what = "Fetch a flight log in real time, by LOG_* and FTP."
    options = read(DownloadOptions, "python -m benchmarks download", what, argv)
    console = console_beside(options.json)
    print(version_and_machine(), file=console)
    try:
        fetched = measure(int(options.size_mb * _MB), Display(console))
    except (ProcessFailed, NothingCame) as error:
        print_error("python -m benchmarks download", error)
        return error.exit_code if isinstance(error, ProcessFailed) else NOT_PASSED
    for each in fetched.downloads:
        same = "identical" if each.identical else "NOT identical"
        times = each.mb_per_s / fetched.logged_mb_per_s
        print(
            f"{each.way:10} {each.size / _MB:6.1f} MB in {each.took_s:5.1f} s: "
            f"{each.mb_per_s:5.2f} MB/s >= {MIN_MB_PER_S:g}, {times:.0f} times what it "
            f"logs, {same}  {'pass' if each.passed else 'FAIL'}",
            file=console,
        )
    print(
        f"meanwhile the flight logged {fetched.logged_mb_per_s:.2f} MB/s; "
        f"late ticks {100.0 * fetched.inner['late_share']:.3f} %, "
        f"wake-up p99 {fetched.inner['lateness_p99_us']:.0f} us",
        file=console,
    )
    write_text(options.json, json_text(_facts(fetched), 1) + "\n")
    return PASSED if fetched.passed else NOT_PASSED


def measure(size: int, display: Display) -> Downloads:
    """Stand on the ground in real time while a log of ``size`` bytes is fetched both ways.

    Raises:
        ProcessFailed: There was no flight.
        NothingCame: The vehicle did not send the log to its end.
    """
    with ExitStack() as stack:
        runs = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="pandion-download-")))
        log = random.Random(0).randbytes(size)  # nothing that could be compressed or left away
        (runs / _EARLIER).mkdir()
        (runs / _EARLIER / "flight.ulg").write_bytes(log)
        parameters = runs / "vehicle.params"  # makes both flights those of one vehicle
        (runs / _EARLIER / MARK).write_bytes(bytes(parameters.resolve()))
        out = runs / "now"
        out.mkdir()
        client = stack.enter_context(closing(DownloadClient()))
        # At the minimum speed each way, and a while to connect.
        duration_s = 2.0 * size / _MB / MIN_MB_PER_S + 2.0
        found: list[Download] = []
        failures: list[NothingCame] = []
        helper = threading.Thread(target=_fetch, args=(client, log, found, failures), daemon=True)
        helper.start()
        sitl = ["ground", "--realtime", f"--duration={duration_s!r}"]
        fsw = [f"--gcs={client.address}", "--api=none", f"--keys={out}", f"--params={parameters}"]
        flown = fly(display, out, sitl, fsw)
        helper.join(timeout=30.0)
        if failures:
            raise failures[0]
        inner = figures(flown)["inner"]
        logged = (out / "flight.ulg").stat().st_size
    return Downloads(tuple(found), logged / duration_s / _MB, client.asked_again, inner)


def _fetch(
    client: DownloadClient, log: bytes, found: list[Download], failures: list[NothingCame]
) -> None:
    """Both ways, one after the other."""
    size = len(log)
    try:
        client.connect(_CONNECT_S)
        numbers = [number for number, bytes_ in client.logs().items() if bytes_ == size]
        if not numbers:
            raise NothingCame(f"the vehicle lists no log of {size} bytes")
        found.append(_timed("LOG_DATA", log, lambda: client.by_log_messages(numbers[0], size)))
        path = f"/logs/{_EARLIER}/flight.ulg"
        found.append(_timed("FTP burst", log, lambda: client.by_ftp(path, size)))
    except NothingCame as error:
        failures.append(error)


def _timed(way: str, log: bytes, fetch: Callable[[], bytes]) -> Download:
    begun_s = time.monotonic()
    data = fetch()
    return Download(way, len(log), time.monotonic() - begun_s, data == log)


def _facts(fetched: Downloads) -> dict[str, Any]:
    return {
        "downloads": [
            {
                "way": each.way,
                "bytes": each.size,
                "seconds": each.took_s,
                "mb_per_s": each.mb_per_s,
                "identical": each.identical,
                "pass": each.passed,
            }
            for each in fetched.downloads
        ],
        "min_mb_per_s": MIN_MB_PER_S,
        "logged_mb_per_s": fetched.logged_mb_per_s,
        "asked_again": fetched.asked_again,
        "cores": os.cpu_count(),
        "load_average_after": round(os.getloadavg()[0], 2),
        "inner": fetched.inner,
    }
