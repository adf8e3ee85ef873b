"""``python -m benchmarks mpc``: the planner's optimiser against others, on recorded requests."""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pandion.output import console_beside, json_target, write_text
from pandion.parser import COULD_NOT_START, Parser
from pandion.progress import Progress
from pandion.version import version

if TYPE_CHECKING:
    from benchmarks.optimiser.measurement import Samples

DONE = 0  # exit code
_PROGRAM = "python -m benchmarks mpc"


@dataclass(frozen=True, slots=True)
class MpcOptions:
    """One measurement."""

    json: str | None
    instances: int | None
    quick: bool
    horizons: tuple[int, ...] | None


def main(argv: list[str]) -> int:
    """Measure and report; returns the exit code."""
    options = _options(argv)
    from studies.one_thread import pin_threads

    pin_threads()  # before NumPy loads
    try:
        return _run(options)
    except OSError as error:
        print(f"{_PROGRAM}: {error}", file=sys.stderr)
        return COULD_NOT_START


def _options(argv: list[str]) -> MpcOptions:
    parser = Parser(_PROGRAM, "Time the planner's optimiser against others.")
    parser.add_argument(
        "--json",
        metavar="FILE",
        type=json_target,
        help="write the rows as a list, and machine, stages and counts beside it as "
        "FILE.machine.json; - for standard output, rows only",
    )
    parser.add_argument(
        "--instances",
        metavar="N",
        type=_count,
        help="of each case and horizon (default 100; slow methods get as many as 25 s allow)",
    )
    parser.add_argument("--quick", action="store_true", help="about a minute, rougher")
    parser.add_argument("--horizons", metavar="N,N", type=_horizons, help="(default 1,5,10,20)")
    read = parser.read(argv)
    return MpcOptions(read.json, read.instances, read.quick, read.horizons)


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 10_000:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of instances")
    return int(text)


def _horizons(text: str) -> tuple[int, ...]:
    parts = text.split(",")
    if not all(part.isdecimal() and 1 <= int(part) <= 50 for part in parts):
        raise argparse.ArgumentTypeError(f"{text!r} is not a list of horizons such as 5,10")
    return tuple(int(part) for part in parts)


def _run(options: MpcOptions) -> int:
    from dataclasses import replace

    from benchmarks.optimiser.measurement import HORIZONS, QUICK, Effort, run
    from benchmarks.optimiser.report import lines, machine

    console = console_beside(options.json)
    effort = QUICK if options.quick else Effort()
    if options.instances is not None:
        effort = replace(effort, instances=options.instances)
    load = os.getloadavg()[0]
    print(
        f"Pandion {version()}: one process, one thread, {os.cpu_count()} cores, load {load:.1f}",
        file=console,
        flush=True,
    )
    with Progress(console, lines=4, threaded=False) as progress:
        measured = run(options.horizons or HORIZONS, effort, progress.report)
    facts = machine(load)
    print("\n".join(lines(measured)), file=console)
    print(
        f"load average {facts['load_average_before']} before, {facts['load_average_after']} after",
        file=console,
    )
    _write(options.json, measured, facts)
    return DONE


def _write(target: str | None, measured: list[Samples], facts: dict[str, object]) -> None:
    from benchmarks.optimiser.report import details

    rows = json.dumps([samples.row() for samples in measured], indent=1, allow_nan=False) + "\n"
    write_text(target, rows)
    if target not in (None, "-"):
        beside = json.dumps({"machine": facts, "details": details(measured)}, indent=1)
        Path(f"{target}.machine.json").write_text(beside + "\n", encoding="utf-8")
