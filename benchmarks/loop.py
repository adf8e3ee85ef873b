"""``python -m benchmarks loop``: fly in real time, alone and beside a busy program."""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TextIO

from benchmarks.bare_loop import BareLoops
from benchmarks.budgets import BudgetRow, Budgets, judge, load_budgets, result
from benchmarks.machine_watch import Watch
from benchmarks.two_processes import figures, fly
from benchmarks.values import several
from command_line.options import json_file, option, read
from command_line.output import console_beside, json_text, print_error, write_text
from command_line.parser import COULD_NOT_START
from command_line.values import seconds, whole
from command_line.version import version
from pandion.display import Display
from pandion.supervisor import ProcessFailed
from sitl.scenario_file import ScenarioError, load_scenario

PASSED, NOT_PASSED = 0, 1  # exit codes
_EXCHANGE = ("receive", "actuate")  # stages
_LINK = (*_EXCHANGE, "publish", "log")  # everything of a tick but the tick itself


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopOptions:
    """One measurement."""

    json: str | None = json_file("the figures")
    duration_s: float = option("--duration S", "of a flight, in seconds", seconds, default=60.0)
    hogs: tuple[int, ...] = option(
        "--hogs N,N",
        "busy programs beside each of the flights (default 0,1: one flight without, one with)",
        several(whole(0, 64), "0,1"),
        default=(0, 1),
    )
    scenario: str = option("--scenario NAME", "what to fly", default="walls")


@dataclass(frozen=True, slots=True)
class Measured:
    """One flight."""

    hogs: int
    rows: list[BudgetRow]
    result: str  # pass, over budget, or too noisy
    facts: dict[str, Any]


def main(argv: list[str]) -> int:
    """Measure and judge; returns the exit code."""
    what = "Fly in real time and judge the timing."
    options = read(LoopOptions, "python -m benchmarks loop", what, argv)
    console = console_beside(options.json)
    budgets = load_budgets()
    machine = _machine()
    print("Pandion {version}: {cores} cores, load {load}, {kernel}".format(**machine), file=console)
    try:
        flown = [_measure(options, hogs, budgets, console) for hogs in options.hogs]
    except ProcessFailed as error:
        print_error("python -m benchmarks loop", error)
        return error.exit_code
    except ScenarioError as error:
        print_error("python -m benchmarks loop", error)
        return COULD_NOT_START
    machine["load_after"] = round(os.getloadavg()[0], 2)
    for measured in flown:
        print("\n".join(_lines(measured)), file=console)
    found = {"machine": machine, "flights": [_as_json(one) for one in flown]}
    write_text(options.json, json_text(found, 2) + "\n")
    return PASSED if all(one.result == "pass" for one in flown) else NOT_PASSED


def _measure(options: LoopOptions, hogs: int, budgets: Budgets, console: TextIO) -> Measured:
    """One flight; its logs are thrown away.

    Raises:
        ProcessFailed: There was no flight.
        ScenarioError: There is no such scenario, or it cannot be read.
    """
    body = load_scenario(options.scenario).body  # as pandion fly has it
    with ExitStack() as stack:
        out = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="pandion-bench-")))
        watch = stack.enter_context(Watch((out / "flight.ulg").exists))
        bare = stack.enter_context(BareLoops())
        for _ in range(hogs):
            stack.enter_context(Hog())
        sitl = [options.scenario, "--realtime", f"--duration={options.duration_s!r}"]
        # Telemetry goes where nothing listens: it is encoded and sent all the same.
        fsw = [f"--body={body}", "--gcs=udp:127.0.0.1:9"]
        flown = fly(Display(console), out, sitl, fsw)
        vehicle = figures(flown)
    assert watch.noise is not None
    inner, stops = vehicle["inner"], bare.stops
    flight = inner["begun_us"], inner["ticks"] + inner["skipped"]
    stopped = None if stops is None else stops.share(*flight)
    elsewhere = None if stops is None else stops.missed_elsewhere(inner["missed_us"], *flight)
    noise = replace(watch.noise, stopped=stopped)
    facts = {
        "scheduler": vehicle["scheduler"],
        "noise": asdict(noise),
        "sleeping_loops_late_us": None if stops is None else stops.late,
        "flown": {} if flown.sitl is None else flown.sitl,
        "vehicle": vehicle,
    }
    rows = judge(_figures(vehicle, watch, elsewhere), budgets)
    return Measured(hogs, rows, result(rows, noise), facts)


def _figures(
    vehicle: dict[str, Any], watch: Watch, elsewhere: float | None
) -> dict[str, dict[str, float | None]]:
    """What was measured, under the names of the budgets."""
    from benchmarks.plant import plant_step_us  # with numba, which a refusal need not wait for

    inner, mpc, stages = vehicle["inner"], vehicle["mpc"], vehicle["stages"]

    def added(names: tuple[str, ...]) -> dict[str, float | None]:
        return {key: sum(stages[name][key] for name in names) for key in ("p50_us", "p99_us")}

    return {
        "wake_up": {"p50_us": inner["lateness_p50_us"], "p99_us": inner["lateness_p99_us"]},
        "ticks": {"late_share": inner["late_share"], "late_share_running": elsewhere},
        "tick": stages["tick"],
        "exchange": added(_EXCHANGE),
        "link": added(_LINK),
        "telemetry": {"p99_us": vehicle["telemetry"]["p99_us"]},
        "mpc": {**mpc, "taken_up_p99_us": mpc["lateness_p99_us"]},
        "plans": {"missed_deadlines": mpc["missed_deadlines"]},
        "memory": {"resident_mb": watch.resident_mb, "growth_mb": watch.growth_mb},
        "plant": {"p50_us": statistics.median(plant_step_us())},
    }


class Hog(subprocess.Popen[bytes]):
    """A program that does nothing but keep a processor busy, and ends with its block."""

    def __init__(self) -> None:
        super().__init__([sys.executable, "-c", "while True: pass"])

    def __exit__(self, *ended: object) -> None:
        self.kill()
        super().__exit__(None, None, None)


def _lines(measured: Measured) -> list[str]:
    facts, noise = measured.facts, measured.facts["noise"]
    beside = {0: "alone", 1: "beside one busy program"}
    head = (
        f"{beside.get(measured.hogs, f'beside {measured.hogs} busy programs')}, "
        f"{facts['scheduler']}; others used {noise['others']:.2f} processors, "
        f"the host took {100.0 * noise['stolen']:.1f} %"
    )
    if noise["stopped"] is not None:
        head += f"; a loop that only sleeps stood still for {100.0 * noise['stopped']:.2g} % of it"
    table = [
        f"  {row.name:<30}{_number(row.value):>12}{_number(row.budget):>12}"
        f"  {'' if row.kept else 'over'}"
        for row in measured.rows
    ]
    return [head, f"  {'':<30}{'measured':>12}{'budget':>12}", *table, f"  {measured.result}"]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.5g}"


def _as_json(measured: Measured) -> dict[str, Any]:
    return {
        "hogs": measured.hogs,
        "result": measured.result,
        "figures": {
            row.name: {"value": row.value, "budget": row.budget, "kept": row.kept}
            for row in measured.rows
        },
        **measured.facts,
    }


def _machine() -> dict[str, Any]:
    return {
        "version": version(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 2),
        "kernel": platform.release(),
        "python": platform.python_version(),
    }
