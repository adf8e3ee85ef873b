"""``python -m benchmarks soak``: an hour in real time with random failures and a busy client.

Memory, handles and threads of every process must stay what they were, and every command must be
answered in time. Where a failure ends the flight, the next one begins, and the end is reported,
with how long the vehicle had waited for a processor: a machine that is shared shows little.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import threading
import time
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from pymavlink import mavutil

from benchmarks.machine_watch import descendants, version_and_machine
from benchmarks.requirement import Requirement, print_requirements
from benchmarks.soak_client import ANSWER_S, COMPONENT, GAP_S, SYSTEM, Client
from benchmarks.soak_faults import scenario
from benchmarks.two_processes import fly
from command_line.options import json_file, option, read
from command_line.output import console_beside, json_text, print_error, write_text
from command_line.values import number, whole
from pandion.display import Display
from pandion.supervisor import ProcessFailed

PASSED, NOT_PASSED = 0, 1  # exit codes
_GLANCE_S: Final = 5.0
_SETTLED_S: Final = 120.0  # from here on nothing may grow
_MIN_GLANCES: Final = 24  # two minutes, to say anything
# Of the time, that a process must have lived for its memory to be judged: what one takes once in
# some minutes is not what it takes in an hour. A planner that nothing happens to lives for half.
_MIN_LIFE: Final = 0.25
_MAX_GROWTH_MB_H: Final = 10.0
_ONCE_MB: Final = 4.0  # that a process may take once: programs kept ready, code that is loaded late
_STEP: Final = 1.5  # what is taken at once in the middle makes a line rise by so much of it
_PARTS: Final = 3  # of a process's life: a leak grows in each, what is taken once in one
_STARVED: Final = 0.1  # of the time that a process waits for a processor: it is not alone
_MAX_FLIGHTS: Final = 3  # an hour: what is injected should not end them
_MAX_GROUNDED: Final = 0.5  # of the time; a soak of a vehicle that stands says little
_RECORDED: Final = ["COMMAND_LONG", "COMMAND_INT", "COMMAND_ACK"]
# A battery lasts 16 minutes: an empty one is told, and neither lands the vehicle nor keeps it down.
_PARAMETERS: Final = """# Pandion
1\t1\tSYS_FAILURE_EN\t1\t6
1\t1\tCOM_LOW_BAT_ACT\t0\t6
1\t1\tCOM_ARM_BAT_MIN\t0\t9
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class SoakOptions:
    """One measurement."""

    json: str | None = json_file("the figures")
    minutes: float = option("--minutes M", "of flight", number(0.2, 10_000.0, "min"), default=60.0)
    seed: int = option("--seed N", "root of all choices", whole(), default=0)
    sensors: str = option("--sensors SUITE", "of the vehicle", default="mocap")


class Glance(NamedTuple):
    """What a process uses at one moment."""

    at_s: float
    private_mb: float  # its own memory; what is read again from a file is not counted
    handles: int
    threads: int
    waited_s: float = 0.0  # for a processor, since it began


@dataclass
class Used:
    """What the processes of one flight have used, by process and time."""

    glances: dict[str, list[Glance]] = field(default_factory=dict)
    begin_s: float = 0.0
    _done: threading.Event = field(default_factory=threading.Event)

    def watch(self, root: int) -> None:
        """Look at all processes below ``root`` until :meth:`stop`."""
        self.begin_s = time.monotonic()
        while not self._done.wait(_GLANCE_S):
            for process in descendants(root):
                with contextlib.suppress(OSError, ValueError, IndexError):
                    name, glance = _glance(process, time.monotonic() - self.begin_s)
                    self.glances.setdefault(f"{name} {process}", []).append(glance)

    def stop(self) -> None:
        """End :meth:`watch`."""
        self._done.set()

    def since(self, moment_s: float) -> dict[str, list[Glance]]:
        """What was used from a moment [s, monotonic] on."""
        begin_s = moment_s - self.begin_s
        later = {
            name: [one for one in glances if one.at_s >= begin_s]
            for name, glances in self.glances.items()
        }
        return {name: glances for name, glances in later.items() if glances}


@dataclass(frozen=True, slots=True)
class Soaked:
    """One flight: what the client heard, what the vehicle recorded, what was used."""

    heard: dict[str, Any]
    dropped: int  # datagrams at the client's own socket
    read: int  # commands of the client that the vehicle recorded
    written: int  # its answers to them
    glances: dict[str, list[Glance]]
    ended: str
    flown_s: float


def main(argv: list[str]) -> int:
    """Measure and judge; returns the exit code."""
    what = "Fly for an hour in real time with random failures and a busy client."
    options = read(SoakOptions, "python -m benchmarks soak", what, argv)
    console = console_beside(options.json)
    print(version_and_machine(), file=console)
    display = Display(console)
    flights: list[Soaked] = []
    ends_s = time.monotonic() + 60.0 * options.minutes
    try:
        while (left_s := ends_s - time.monotonic()) > _GLANCE_S:
            one = soak(options, len(flights), left_s, display)
            flights.append(one)
            display.say(f"flight {len(flights)}: {one.flown_s:.0f} s, {one.ended}")
    except ProcessFailed as error:
        print_error("python -m benchmarks soak", error)
        return error.exit_code
    rows = judge(flights)
    print_requirements(rows, console)
    print(stood_still(flights), file=console)
    print(starved(flights), file=console)
    figures = {
        "rows": [row.as_json() for row in rows],
        "flights": [asdict(one) for one in flights],
    }
    write_text(options.json, json_text(figures, 1) + "\n")
    return PASSED if all(row.passed for row in rows) else NOT_PASSED


def soak(options: SoakOptions, flight: int, left_s: float, display: Display) -> Soaked:
    """One flight, until the time is over or the vehicle is.

    Raises:
        ProcessFailed: There was no flight.
    """
    with tempfile.TemporaryDirectory(prefix="pandion-soak-") as folder:
        out, client, used = Path(folder), Client(1000 * options.seed + flight), Used()
        parameters = out / "soak.params"
        parameters.write_text(_PARAMETERS, encoding="ascii")
        watch = threading.Thread(target=used.watch, args=(os.getpid(),), daemon=True)
        watch.start()
        client.start()
        failing = out / "failing.toml"
        failing.write_text(scenario(1000 * options.seed + flight, left_s), encoding="ascii")
        sitl = [str(failing), "--realtime", f"--duration={left_s!r}", f"--seed={flight}"]
        sitl += [f"--sensors={options.sensors}"]
        fsw = [f"--gcs=udp:127.0.0.1:{client.port}", "--api=none", f"--keys={out}"]
        fsw += [f"--params={parameters}", "--body=full"]
        try:
            flown = fly(display, out, sitl, fsw)
        finally:
            used.stop()
            dropped = client.dropped
            client.close()
            watch.join()
        if flown.interrupted or flown.sitl is None:
            raise ProcessFailed(flown.failure or "interrupted", exit_code=NOT_PASSED)
        asked, answered = recorded(out / "flight.tlog")
    return Soaked(
        heard=asdict(client.heard),
        dropped=dropped or 0,
        read=asked,
        written=answered,
        # Compiling kernels, which the first flight may begin with, is no part of a flight.
        glances=used.since(client.first_heard_s),
        ended=flown.failure or str(flown.sitl["end_reason"]),
        flown_s=float(flown.sitl["duration_s"]),
    )


def judge(flights: list[Soaked]) -> list[Requirement]:
    """What must hold after all flights."""
    answers = [wait for one in flights for wait in one.heard["answered_s"]]
    unanswered = sum(len(one.heard["unanswered"]) for one in flights)
    lost = sum(one.read - one.written for one in flights)
    growth: dict[str, tuple[float, float]] = {}  # and what it may be; of the worst process
    for one in flights:
        for name, glances in one.glances.items():
            for what, found in grown(glances, _MIN_LIFE * one.flown_s).items():
                kind = f"{name.split()[0]}: {what}"
                worst = growth.setdefault(kind, found)
                growth[kind] = max(worst, found, key=lambda it: it[0] - it[1])
    flown_s = max(sum(one.flown_s for one in flights), 1.0)
    aloft_s = sum(one.heard["airborne_s"] for one in flights)
    hours = flown_s / 3600.0
    rows = [
        Requirement("commands without an answer within 1 s", unanswered, 0),
        Requirement("command to answer, longest", max(answers, default=9.9), ANSWER_S, "s"),
        Requirement("commands that were read and not answered", lost, 0),
        Requirement(
            "parameters without an answer",
            sum(one.heard["parameters_missing"] for one in flights),
            0,
        ),
        Requirement("flights an hour", len(flights) / max(hours, 1.0), _MAX_FLIGHTS),
        Requirement("share of the time on the ground", 1.0 - aloft_s / flown_s, _MAX_GROUNDED),
    ]
    # What did not live for long enough is not judged, and says nothing.
    unjudged = sum(f"{name}: memory" not in growth for name in ("fsw", "planner", "sitl"))
    rows.append(Requirement("processes that were not seen for long enough", unjudged, 0))
    for name, (value, most) in sorted(growth.items()):
        unit = "MB/h" if "memory" in name else ""
        rows.append(Requirement(f"{name}, growth", value, most, unit))
    return rows


def stood_still(flights: list[Soaked]) -> str:
    """Say how long client and vehicle were silent: where both were, the machine stood still."""
    most = {
        name: max((gap[1] for one in flights for gap in one.heard[name]), default=0.0)
        for name in ("pauses", "gaps")
    }
    return (
        f"Longest pause of the client {most['pauses']:.2f} s, longest gap between two datagrams "
        f"of the vehicle {most['gaps']:.2f} s (0 where all were below {GAP_S:g} s)."
    )


def starved(flights: list[Soaked]) -> str:
    """Say how long the vehicle's processes waited for a processor, and how each flight ended."""
    lines = []
    for k, one in enumerate(flights, 1):
        waits = {name: waited(one.glances[name]) for name in sorted(one.glances)}
        part = {name.split()[0]: share for name, share in waits.items() if share is not None}
        most = max((share[1] for share in part.values()), default=0.0)
        said = ", ".join(f"{name} {100.0 * share[0]:.0f} %" for name, share in part.items())
        verdict = "; it was starved, and shows little" if most >= _STARVED else ""
        lines.append(
            f"Flight {k} waited for a processor: {said}, "
            f"at most {100.0 * most:.0f} % of half a minute{verdict}."
        )
    return "\n".join(lines)


def waited(glances: list[Glance]) -> tuple[float, float] | None:
    """Share [1] of the time that a process waited for a processor; of all, and of half a minute."""
    if len(glances) < 2:
        return None
    steps = round(30.0 / _GLANCE_S)
    pairs = [(glances[0], glances[-1]), *zip(glances, glances[steps:], strict=False)]
    share = [(b.waited_s - a.waited_s) / max(b.at_s - a.at_s, _GLANCE_S) for a, b in pairs]
    return share[0], max(share)


def grown(glances: list[Glance], min_s: float = 0.0) -> dict[str, tuple[float, float]]:
    """By what a process has grown since it had settled, and by what it may.

    Memory [MB/h] twice: by a line through all of it, and as it grows at least in each part, which
    tells a leak from what is taken once. It is left out of a process that was seen for less than
    ``min_s`` [s].
    """
    settled = [one for one in glances if one.at_s >= glances[0].at_s + _SETTLED_S]
    if len(settled) < _MIN_GLANCES:
        return {}
    quarter = max(len(settled) // 4, 1)
    first, last = settled[:quarter], settled[-quarter:]
    found: dict[str, tuple[float, float]] = {
        "handles": (max(one.handles for one in last) - max(one.handles for one in first), 0.0),
        "threads": (max(one.threads for one in last) - max(one.threads for one in first), 0.0),
    }
    if glances[-1].at_s - glances[0].at_s < min_s:
        return found
    hours = (settled[-1].at_s - settled[0].at_s) / 3600.0
    ends = [round(k * len(settled) / _PARTS) for k in range(_PARTS + 1)]
    parts = [settled[begin:end] for begin, end in pairwise(ends)]
    once = max(_MAX_GROWTH_MB_H, _STEP * _ONCE_MB / hours)
    return found | {
        "memory": (_slope(settled), once),
        "memory, steady": (min(map(_slope, parts)), _MAX_GROWTH_MB_H),
    }


def _slope(glances: list[Glance]) -> float:
    """Memory by a line [MB/h]."""
    line = np.polyfit([one.at_s for one in glances], [one.private_mb for one in glances], 1)
    return 3600.0 * float(line[0])


def recorded(tlog: Path) -> tuple[int, int]:
    """Commands of the client, and answers to it, that the vehicle's own record has."""
    record: Any = mavutil.mavlogfile(str(tlog))
    asked = answered = 0
    while (message := record.recv_match(type=_RECORDED)) is not None:
        if message.get_type() == "COMMAND_ACK":
            answered += (message.target_system, message.target_component) == (SYSTEM, COMPONENT)
        else:
            asked += (message.get_srcSystem(), message.get_srcComponent()) == (SYSTEM, COMPONENT)
    return asked, answered


def _glance(process: int, at_s: float) -> tuple[str, Glance]:
    home = Path(f"/proc/{process}")
    lines = (line.split(":", 1) for line in (home / "status").read_text().splitlines())
    status = {one[0]: one[1] for one in lines if len(one) == 2}
    name = _half(process)
    if name == "fsw" and _half(int(status["PPid"])) == "fsw":
        name = "planner"  # or what it is forked from
    private = sum(int(status[key].split()[0]) for key in ("RssAnon", "VmSwap")) / 1024.0
    handles = len(list((home / "fd").iterdir()))
    waits_s = 1e-9 * int((home / "schedstat").read_text().split()[1])
    threads = int(status["Threads"])
    return name, Glance(round(at_s, 1), round(private, 2), handles, threads, round(waits_s, 3))


def _half(process: int) -> str:
    """Which of the two programs a process belongs to, by its command line."""
    words = Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
    return next((word.decode() for word in words if word in (b"fsw", b"sitl")), "other")
