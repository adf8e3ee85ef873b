"""The bench in words: a table, the stages of ours, and the ratios against their targets."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.optimiser.measurement import Samples

OURS = ("clarabel", 2)  # as it flies
# Minimum factors at n = 5 and n = 10 by which the others should be slower.
TARGETS = {
    "slsqp-numeric": {5: 150.0, 10: 250.0},
    "slsqp-analytic": {5: 6.0, 10: 10.0},
    "casadi-ipopt": {5: 5.0, 10: 4.0},
    "casadi-fatrop": {5: 1.5, 10: 1.3},
}
STEP_TARGET_US = {5: (600.0, 1000.0)}  # median, p99 with 2 iterations on an unloaded core
PERIOD_US, FITS = 100_000.0, 50  # n = 20 should fit the period so often
_PACKAGES = ("numpy", "scipy", "clarabel", "numba", "casadi")


def lines(all_samples: list[Samples]) -> list[str]:
    """The whole report, a line each."""
    parts = (_table, _given, _stages, _results)
    return [line for part in parts for line in ("", *part(all_samples))][1:]


def _table(all_samples: list[Samples]) -> list[str]:
    head = (
        f"{'n':>3}  {'method':<15} {'SQP it':>6} {'median us':>10} {'cpu us':>10} "
        f"{'p99 us':>10} {'max us':>10} "
        f"{'sub-optimal':>11} {'instances':>9} {'failed':>6}"
    )
    found = [head, "-" * len(head)]
    for samples in all_samples:
        row = samples.row()
        start = f"{row['n']:>3}  {row['method']:<15} {row['sqp_iterations'] or '':>6}"
        if samples.entry.build is None:
            found.append(f"{start} not installed")
            continue
        shown_times = (row["median_us"], samples.cpu_median_us(), row["p99_us"], row["max_us"])
        times = " ".join(f"{_number(time):>10}" for time in shown_times)
        excess = row["suboptimality_p50"]
        shown = "" if excess is None else f"{100.0 * float(excess):.3f} %"
        found.append(f"{start} {times} {shown:>11} {len(samples.answers):>9} {samples.failed:>6}")
    return found


def _given(all_samples: list[Samples]) -> list[str]:
    """What each method begins from and in what form it computes."""
    by_name = {s.entry.name: s.entry for s in all_samples}
    found = ["what was given to each:"]
    for name, entry in by_name.items():
        found.append(f"  {name:<15} {'not installed' if entry.build is None else entry.given}")
    return found


def _stages(all_samples: list[Samples]) -> list[str]:
    found = ["stages of ours, median us: linearise and fill, update and solve, the rest"]
    for samples in all_samples:
        stages = samples.stages()
        if stages is not None:
            times = " ".join(f"{stage:>9.0f}" for stage in stages)
            name = f"{samples.entry.name} {samples.entry.sqp_iterations}"
            found.append(f"{samples.horizon:>3}  {name:<15} {times}")
    return found


def _results(all_samples: list[Samples]) -> list[str]:
    """Ratios of medians against ours, and whether each is what it should be."""
    known = {(s.entry.name, s.entry.sqp_iterations, s.horizon): s for s in all_samples}
    own_name, iterations = OURS
    found = [
        f"slower than {own_name} with {iterations} SQP iterations, by median wall time and "
        "processor time:"
    ]
    for name, targets in TARGETS.items():
        for n, least in targets.items():
            theirs, ours = known.get((name, None, n)), known.get((own_name, iterations, n))
            if theirs is not None and ours is not None:
                found.append(f"  n = {n:>2}  {name:<15} {_ratios(theirs, ours, least)}")
    for n, (median, p99) in STEP_TARGET_US.items():
        if (step := known.get((own_name, iterations, n))) is not None:
            times = [answer.spent.wall_us for answer in step.answers]
            its_median, its_p99 = np.median(times), np.percentile(times, 99.0)
            good = bool(its_median <= median and its_p99 <= p99)
            found.append(
                f"MPC step at n = {n}: {its_median:.0f} us median, {its_p99:.0f} us p99, "
                f"targets {median:.0f} and {p99:.0f} on an unloaded core: {_met(good)}"
            )
    if (step := known.get((own_name, iterations, 20))) is not None:
        fits = PERIOD_US / float(np.median([answer.spent.wall_us for answer in step.answers]))
        found.append(
            f"n = 20 fits the 100 ms {fits:.0f} times, target {FITS}: {_met(fits >= FITS)}"
        )
    return found


def _ratios(theirs: Samples, ours: Samples, least: float) -> str:
    """A long call is interrupted more on a busy machine: both ratios must reach the target."""
    wall, own_wall = theirs.row()["median_us"], ours.row()["median_us"]
    cpu, own_cpu = theirs.cpu_median_us(), ours.cpu_median_us()
    if theirs.entry.build is None:
        return "not installed"
    if not (wall and own_wall and cpu and own_cpu):
        return "not measured"
    by_wall, by_cpu = float(wall) / float(own_wall), cpu / own_cpu
    met = _met(min(by_wall, by_cpu) >= least)
    return f"{by_wall:>7.1f} x {by_cpu:>7.1f} x, target {least:g}: {met}"


def machine(load_before: float) -> dict[str, Any]:
    """What the numbers depend on besides the code; ``load_before`` [1] is a load average."""
    return {
        "cores": os.cpu_count(),
        "processor": _processor(),
        "load_average_before": round(load_before, 2),
        "load_average_after": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "blas_threads": 1,
        "versions": {name: _version(name) for name in _PACKAGES},
    }


def details(all_samples: list[Samples]) -> list[dict[str, Any]]:
    """Counts and stages of every row, for the file beside the rows."""
    return [
        {
            "n": samples.horizon,
            "method": samples.entry.name,
            "sqp_iterations": samples.entry.sqp_iterations,
            "instances": len(samples.answers),
            "failed": samples.failed,
            "installed": samples.entry.build is not None,
            "given": samples.entry.given,
            "cpu_median_us": samples.cpu_median_us(),
            "stages_us": samples.stages(),
        }
        for samples in all_samples
    ]


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in text.splitlines() if "model name" in line]
    return names[0] if names else platform.processor()


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _number(value: object) -> str:
    return f"{value:.0f}" if isinstance(value, float) else ""


def _met(good: bool) -> str:
    return "met" if good else "not met"
