"""``python -m benchmarks mpc``: the planner's optimiser against others, on recorded requests."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.values import several
from command_line.options import json_file, option, read, switch
from command_line.output import console_beside, json_text, print_error, write_text
from command_line.parser import COULD_NOT_START
from command_line.values import whole
from command_line.version import version
from pandion.display import Display

if TYPE_CHECKING:
    from benchmarks.optimiser.measurement import Samples

DONE = 0  # exit code
_PROGRAM = "python -m benchmarks mpc"


@dataclass(frozen=True, slots=True, kw_only=True)
class MpcOptions:
    """One measurement."""

    # Beside a file, FILE.machine.json gets machine, stages and counts.
    json: str | None = json_file("the rows")
    instances: int | None = option(
        "--instances N",
        "of each case and horizon (default 100; slow methods get as many as 25 s allow)",
        whole(1, 10_000),
    )
    quick: bool = switch("--quick", "about a minute, rougher")
    horizons: tuple[int, ...] | None = option(
        "--horizons N,N", "of the planner (default 1,5,10,20)", several(whole(1, 50), "5,10")
    )


def main(argv: list[str]) -> int:
    """Measure and report; returns the exit code."""
    options = read(MpcOptions, _PROGRAM, "Time the planner's optimiser against others.", argv)

    try:
        return _run(options)
    except OSError as error:
        print_error(_PROGRAM, error)
        return COULD_NOT_START


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
    display = Display(console, lines=4, threaded=False)
    with display.progress():
        measured = run(options.horizons or HORIZONS, effort, display.report)
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

    rows = json_text([samples.row() for samples in measured], 1) + "\n"
    write_text(target, rows)
    if target not in (None, "-"):
        beside = json_text({"machine": facts, "details": details(measured)}, 1)
        Path(f"{target}.machine.json").write_text(beside + "\n", encoding="utf-8")
