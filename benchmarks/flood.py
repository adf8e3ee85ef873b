"""``python -m benchmarks flood``: fly in real time under 5000 useless datagrams a second."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.flood_monitor import Heard, Monitor
from benchmarks.flood_traffic import SYSTEM
from benchmarks.machine_watch import version_and_machine
from benchmarks.requirement import Requirement, print_requirements
from benchmarks.two_processes import figures, fly
from command_line.options import json_file, option, read
from command_line.output import console_beside, json_text, print_error, write_text
from command_line.values import seconds
from fsw.link.telemetry.streams import STREAMS
from pandion.display import Display
from pandion.supervisor import ProcessFailed

PASSED, NOT_PASSED = 0, 1  # exit codes
RATE_HZ: Final = 5000.0
SETTLE_S: Final = 2.0  # of a flight, before anything is counted
MAX_GAP_S: Final = 1.5
MAX_ACK_S: Final = 0.050
RATE_TOLERANCE: Final = 0.10
# Two flights on one machine differ by this much without any flood.
LATENESS_FACTOR: Final = 1.25
LATENESS_SLACK_US: Final = 50.0
_ACCEPTED: Final = 0  # MAV_RESULT
_COUNTED_HZ: Final = 4.0  # slower streams are too few to count in a minute


@dataclass(frozen=True, slots=True, kw_only=True)
class FloodOptions:
    """One measurement."""

    json: str | None = json_file("the figures")
    duration_s: float = option("--duration S", "of the flood, in seconds", seconds, default=60.0)


@dataclass(frozen=True, slots=True)
class Flight:
    """One flight and what was seen of it."""

    heard: Heard
    vehicle: dict[str, Any]  # fsw.json
    sitl: dict[str, Any]
    sent: int
    sent_valid: int


def main(argv: list[str]) -> int:
    """Measure and judge; returns the exit code."""
    what = "Fly in real time under a flood of useless datagrams."
    options = read(FloodOptions, "python -m benchmarks flood", what, argv)
    console = console_beside(options.json)
    print(version_and_machine(), file=console)
    try:
        calm = measure(options.duration_s, flooded=False, display=Display(console))
        flooded = measure(options.duration_s, flooded=True, display=Display(console))
    except ProcessFailed as error:
        print_error("python -m benchmarks flood", error)
        return error.exit_code
    rows = [*correctness(flooded), *timing(flooded, calm)]
    print_requirements(rows, console)
    _write(options.json, rows, calm, flooded)
    return PASSED if all(row.passed for row in rows) else NOT_PASSED


def measure(duration_s: float, *, flooded: bool, display: Display) -> Flight:
    """Fly the walls once, and flood the ground station's link for ``duration_s`` if asked to.

    Raises:
        ProcessFailed: There was no flight.
    """
    with ExitStack() as stack:
        out = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="pandion-flood-")))
        sender = stack.enter_context(_sender())
        monitor = stack.enter_context(closing(Monitor()))
        counts: list[str] = []
        helper = threading.Thread(
            target=_flood,
            args=(monitor, sender, duration_s if flooded else 0.0, counts),
            daemon=True,
        )
        helper.start()
        sitl = ["walls", "--realtime", f"--duration={duration_s + SETTLE_S + 1.0!r}"]
        fsw = [f"--gcs={monitor.address}", "--api=none", f"--keys={out}"]
        flown = fly(display, out, sitl, fsw)
        helper.join(timeout=5.0)
        vehicle = figures(flown)
        if flown.interrupted or flown.sitl is None:
            raise ProcessFailed(flown.failure or "interrupted", exit_code=NOT_PASSED)
    sent, sent_valid = (int(count) for count in counts) if counts else (0, 0)
    return Flight(
        heard=monitor.heard, vehicle=vehicle, sitl=flown.sitl, sent=sent, sent_valid=sent_valid
    )


@contextmanager
def _sender() -> Iterator[subprocess.Popen[str]]:
    """The flood's process, started before the flight: only its sending is to be measured."""
    words = [sys.executable, "-P", "-m", "benchmarks.flood_traffic"]
    pipe = subprocess.PIPE
    with subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True) as sender:
        try:
            yield sender
        finally:
            sender.kill()


def _flood(
    monitor: Monitor, sender: subprocess.Popen[str], duration_s: float, counts: list[str]
) -> None:
    """Wait for the vehicle to fly, then send; nothing is counted before."""
    while monitor.vehicle is None:
        time.sleep(0.05)
    time.sleep(SETTLE_S)
    monitor.restart()
    if duration_s > 0.0:
        counts += sender.communicate(f"{monitor.vehicle[1]} {RATE_HZ} {duration_s}\n")[0].split()


def correctness(flight: Flight) -> list[Requirement]:
    """What must hold on any machine: nothing invalid did anything."""
    link = flight.vehicle["links"]["gcs"]
    heard = flight.heard
    accepted = [ack for ack in heard.others if ack[1] == _ACCEPTED]
    strangers = [ack for ack in heard.others if ack[2:] != (SYSTEM, SYSTEM)]
    own = heard.asked + len(heard.heartbeats) + 60  # commands and heartbeats of the monitor
    return [
        Requirement("commands of the flood that were accepted", len(accepted), 0),
        Requirement("acknowledgements to strangers", len(strangers), 0),
        Requirement(
            "frames believed beyond the valid ones",
            link["frames_accepted"] - own - flight.sent_valid,
            0,
        ),
        # The monitor, and the one socket of the flood that sent valid frames.
        Requirement("peers", link["peers"], 2),
        Requirement("services that failed", link["service_failures"], 0),
        Requirement("messages that could not be encoded", link["encode_failures"], 0),
    ]


def timing(flight: Flight, calm: Flight) -> list[Requirement]:
    """What depends on the machine as well."""
    heard = flight.heard
    gaps = [b - a for a, b in itertools.pairwise(heard.heartbeats)]
    inner, before = flight.vehicle["inner"], calm.vehicle["inner"]
    rows = [
        Requirement(
            "command to acknowledgement, longest",
            max(heard.acknowledged_s, default=9.9),
            MAX_ACK_S,
            "s",
        ),
        Requirement("changes of mode", max(len(heard.modes) - 1, 0), 0),
        Requirement("heartbeat, largest gap", max(gaps, default=float("nan")), MAX_GAP_S, "s"),
        Requirement("commands without an answer", heard.asked - len(heard.acknowledged_s), 1),
        Requirement("telemetry rate, largest deviation", rate_deviation(heard), RATE_TOLERANCE),
    ]
    for name in ("lateness_p50_us", "lateness_p99_us"):
        bound = max(LATENESS_FACTOR * before[name], before[name] + LATENESS_SLACK_US)
        rows.append(
            Requirement(f"inner loop, {name[:-3].replace('_', ' ')}", inner[name], bound, "us")
        )
    return rows


def rate_deviation(heard: Heard) -> float:
    """Largest relative deviation of a stream from its rate, in the vehicle's own time."""
    seconds = 1e-6 * (heard.last_us - heard.first_us)
    deviations = [
        abs(
            heard.counts[(stream.component, stream.message_id)] / (seconds * stream.ground_hz) - 1.0
        )
        for stream in STREAMS
        if stream.ground_hz >= _COUNTED_HZ and (stream.component, stream.message_id) in heard.counts
    ]
    return max(deviations, default=float("nan")) if seconds > 0.0 else float("nan")


def _write(target: str | None, rows: list[Requirement], calm: Flight, flooded: Flight) -> None:
    if target is None:
        return
    found = {
        "rows": [row.as_json() for row in rows],
        "datagrams_sent": flooded.sent,
        "valid_frames_sent": flooded.sent_valid,
        "cores": os.cpu_count(),
        "load_average_after": round(os.getloadavg()[0], 2),
        "without": _facts(calm),
        "with": _facts(flooded),
    }
    write_text(target, json_text(found, 1) + "\n")


def _facts(flight: Flight) -> dict[str, Any]:
    waits = sorted(flight.heard.acknowledged_s)
    return {
        "inner": flight.vehicle["inner"],
        "links": flight.vehicle["links"],
        "inbox_refused": flight.vehicle["inbox_refused"],
        "acknowledged": len(waits),
        "acknowledged_p50_s": waits[len(waits) // 2] if waits else None,
        "acknowledged_max_s": waits[-1] if waits else None,
        "sitl": flight.sitl,
    }
