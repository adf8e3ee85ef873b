"""``python -m benchmarks lockstep``: how fast a whole flight is, and where its time goes.

Everything is on: both processes, telemetry, logs, the MPC. The peer is the same loop with
pymavlink's own packing of the lockstep frames, or, for a suite of ``--sensors``, the same flight
with exact states. The two take turns: a busy machine slows both.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TextIO

from benchmarks.two_processes import figures, fly
from command_line.options import json_file, option, read
from command_line.output import console_beside, json_text, print_error, write_text
from command_line.parser import COULD_NOT_START
from command_line.values import number, one_of, whole
from command_line.version import version
from pandion.display import Display
from pandion.processor import Places, lockstep_places
from pandion.supervisor import ProcessFailed
from sitl.scenario_file import PERFECT, SUITE_NAMES, ScenarioError, load_scenario

DONE, SLOW = 0, 1  # exit codes
TARGET: Final = 25.0  # times real time, at 500 Hz
PEER: Final = "benchmarks.pymavlink_process"
MIN_RATIO: Final = 0.85  # of a suite of sensors, to the speed with exact states


@dataclass(frozen=True, slots=True, kw_only=True)
class LockstepOptions:
    """One measurement."""

    json: str | None = json_file("the result")
    scenario: str = option("--scenario NAME", "what to fly", default="walls")
    sensors: str = option(
        "--sensors SUITE",
        f"of the vehicle: {', '.join(SUITE_NAMES)}; any other is compared with {PERFECT}",
        one_of("suite", *SUITE_NAMES),
        default=PERFECT,
    )
    duration_s: float = option(
        "--duration S", "of a flight, in seconds", number(1.0, 600.0, "s"), default=60.0
    )
    rounds: int = option("--rounds N", "flights of each", whole(1, 100), default=3)
    processors: int | None = option(
        "--processors N",
        "how many the two processes share, 1 or 2 (default as pandion fly decides, by what is "
        "idle)",
        whole(1, 2),
    )


def main(argv: list[str]) -> int:
    """Measure and report; returns the exit code: 1 if the best flight was too slow."""
    what = "Time a whole flight in lockstep and its peer."
    options = read(LockstepOptions, "python -m benchmarks lockstep", what, argv)
    console = console_beside(options.json)
    try:
        found = _measure(options, console)
    except (ProcessFailed, ScenarioError, OSError) as error:
        print_error("python -m benchmarks lockstep", error)
        return COULD_NOT_START
    write_text(options.json, json_text(found, 1) + "\n")
    print("\n".join(_lines(found)), file=console)
    return DONE if _met(found) else SLOW


def _met(found: dict[str, Any]) -> bool:
    if found["sensors"] == PERFECT:
        return bool(found["real_time_factor_best"] >= TARGET)
    return bool(found["ratio"] >= MIN_RATIO)


@dataclass(frozen=True, slots=True)
class _Kind:
    """One of the two that take turns."""

    name: str
    sensors: str
    runner: str | None = None


def _kinds(sensors: str) -> tuple[_Kind, _Kind]:
    if sensors == PERFECT:
        return _Kind("pandion", PERFECT), _Kind("pymavlink", PERFECT, PEER)
    return _Kind(sensors, sensors), _Kind(PERFECT, PERFECT)


def _measure(options: LockstepOptions, console: TextIO) -> dict[str, Any]:
    load = os.getloadavg()[0]
    kinds = _kinds(options.sensors)
    flights: dict[str, list[dict[str, Any]]] = {kind.name: [] for kind in kinds}
    for round_ in range(1, options.rounds + 1):
        for kind in kinds:
            flown = _measure_one(options, kind)
            flights[kind.name].append(flown)
            said = f"{_factor(flown):.1f} times real time"
            print(f"round {round_}, {kind.name}: {said}", file=console, flush=True)
    ours, theirs = ([_factor(flown) for flown in flights[kind.name]] for kind in kinds)
    best, other = (max(flights[kind.name], key=_factor) for kind in kinds)
    return {
        "version": version(),
        "scenario": options.scenario,
        "sensors": options.sensors,
        "duration_s": options.duration_s,
        "rate_hz": 500,
        "real_time_factor": statistics.median(ours),
        "real_time_factor_best": max(ours),
        "rounds": ours,
        "peer": kinds[1].name,
        "peer_rounds": theirs,
        "ratio": statistics.median(one / two for one, two in zip(ours, theirs, strict=True)),
        "ratio_best": max(ours) / max(theirs),
        "peer_stages_us": _stages(other),
        "stages_us": _stages(best),
        "places": best["places"],
        "cores": os.cpu_count(),
        "load_average_before": round(load, 2),
        "load_average_after": round(os.getloadavg()[0], 2),
    }


def _factor(flown: dict[str, Any]) -> float:
    return float(flown["sitl"]["real_time_factor"])


class _Silent(Display):
    """Says nothing: the bench has lines of its own."""

    def say(self, sentence: str) -> None:
        """See :class:`Display`."""

    def flying(self, *_: Any) -> None:
        """See :class:`Display`."""


def _measure_one(options: LockstepOptions, kind: _Kind) -> dict[str, Any]:
    """One flight; what both processes wrote about it.

    Raises:
        ProcessFailed: It did not begin, or did not end as it should.
    """
    with tempfile.TemporaryDirectory(prefix="pandion-bench-") as name:
        out, places = Path(name), _places(options.processors)
        sitl = [options.scenario, f"--sensors={kind.sensors}"]
        sitl += [f"--duration={options.duration_s!r}"]
        fsw = [f"--body={load_scenario(options.scenario).body}"]  # as pandion fly has it
        flown = fly(_Silent(sys.stderr), out, sitl, fsw, places, kind.runner)
        if flown.failure is not None or flown.sitl is None or flown.interrupted:
            raise ProcessFailed(flown.failure or "the flight was interrupted", exit_code=1)
        return {"sitl": flown.sitl, "fsw": figures(flown), "places": _described(places)}


def _places(processors: int | None) -> Places:
    places = lockstep_places()
    if processors is None or places.sitl is None:
        return places
    allowed = sorted(os.sched_getaffinity(0))
    return Places(allowed[0], allowed[min(processors, len(allowed)) - 1])


def _described(places: Places) -> str:
    if places.sitl is None:
        return "wherever the system likes"
    together = places.sitl == places.fsw
    return "both processes on one processor" if together else "a processor for each process"


def _stages(flown: dict[str, Any]) -> dict[str, float]:
    """Microseconds a step: means of the whole, medians of the flight software's stages."""
    sitl, fsw = flown["sitl"], flown["fsw"]
    steps = max(sitl["steps"], 1)
    whole, waited = 1e6 * sitl["wall_s"] / steps, 1e6 * sitl["waited_s"] / steps
    stages, mpc = fsw["stages"], fsw["mpc"]
    per_plan = 500.0 / mpc["rate_hz"]
    return {
        "step": whole,
        "simulator": whole - waited,
        "wait for the answer": waited,
        "fsw receive": stages["receive"]["p50_us"],
        "fsw tick": stages["tick"]["p50_us"],
        "fsw send": stages["actuate"]["p50_us"],
        "fsw telemetry and log": fsw["telemetry"]["p50_us"],
        "mpc, share of a step": mpc["p50_us"] / per_plan,
        "mpc, a cycle": mpc["p50_us"],
    }


def _lines(found: dict[str, Any]) -> list[str]:
    theirs = found["peer_stages_us"]
    rows = [
        f"  {name:<24}{value:8.1f}{theirs[name]:11.1f} us"
        for name, value in found["stages_us"].items()
    ]
    met = "met" if _met(found) else "missed"
    factor = f"median {found['real_time_factor']:.1f}, best {found['real_time_factor_best']:.1f}"
    if found["sensors"] == PERFECT:
        last = [
            f"{factor} times real time (target {TARGET:g}: {met})",
            f"{found['ratio']:.2f} times as fast as with pymavlink's packing",
        ]
    else:
        last = [
            f"{factor} times real time",
            f"{found['ratio']:.2f} times as fast as with exact states (target {MIN_RATIO:g}: "
            f"{met}), best to best {found['ratio_best']:.2f}",
        ]
    return [
        f"{found['scenario']}, {found['duration_s']:g} s at 500 Hz, {found['sensors']} sensors, "
        f"beside {found['peer']}, {found['places']}:",
        *rows,
        *last,
        f"{found['cores']} cores, load average {found['load_average_before']} before, "
        f"{found['load_average_after']} after",
    ]
