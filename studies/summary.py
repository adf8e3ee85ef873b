"""Many flights of one cell, in numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from studies.campaign import Campaign
from studies.job import Job, Outcome
from studies.statistics import wilson


@dataclass(frozen=True, slots=True)
class Summary:
    """Averages over the flights of a cell, and the worst of what must not be averaged."""

    passed: int
    total: int
    flown: int  # distinct flights; 1 in calm air, where every seed flies the same
    te_m: float | None  # mean of the flights' TE
    te_worst_m: float | None
    worst_margin_m: float | None
    cs_mean: float  # per planning step
    ce_mean: float
    cs_sum: float  # over a flight, as the paper defines it
    ce_sum: float
    tc_p50_us: float
    tc_p99_us: float
    wilson_low: float  # of the distinct flights
    wilson_high: float
    planning_failures: int

    def as_json(self) -> dict[str, Any]:
        """Every field by name."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Cell:
    """What a cell of a table flies: one job a seed."""

    jobs: tuple[Job, ...]


def fly_cells(campaign: Campaign, cells: Sequence[Cell]) -> tuple[list[Summary], tuple[str, ...]]:
    """Fly all cells as one campaign; the second value names flights that broke."""
    outcomes = campaign.fly([job for cell in cells for job in cell.jobs])
    summaries, begin = [], 0
    for cell in cells:
        end = begin + len(cell.jobs)
        summaries.append(summarise(cell.jobs, outcomes[begin:end]))
        begin = end
    errors = {f"seed {row.seed}: {row.reason}" for row in outcomes if row.error}
    return summaries, tuple(sorted(errors))


def summarise(jobs: Sequence[Job], outcomes: Sequence[Outcome]) -> Summary:
    """The numbers of one cell, from the outcome of each of its jobs."""
    total = len(outcomes)
    flown = len({job.key() for job in jobs})
    passed = sum(row.completed for row in outcomes)
    low, high = wilson(round(passed * flown / total), flown)
    whole = [row for row in outcomes if not row.error]
    errors = [row.te_m for row in whole if row.te_m is not None]
    margins = [row.margin_m for row in whole if row.margin_m is not None]

    def mean(field: Callable[[Outcome], float]) -> float:
        return float(np.mean([field(row) for row in whole])) if whole else 0.0

    return Summary(
        passed=passed,
        total=total,
        flown=flown,
        te_m=float(np.mean(errors)) if errors else None,
        te_worst_m=max(errors, default=None),
        worst_margin_m=min(margins, default=None),
        cs_mean=mean(lambda row: row.cs_mean),
        ce_mean=mean(lambda row: row.ce_mean),
        cs_sum=mean(lambda row: row.cs_sum),
        ce_sum=mean(lambda row: row.ce_sum),
        tc_p50_us=mean(lambda row: row.tc_p50_us),
        tc_p99_us=mean(lambda row: row.tc_p99_us),
        wilson_low=low,
        wilson_high=high,
        planning_failures=sum(row.failures for row in whole),
    )


def seen(summary: Summary) -> str:
    """Passed of total, for a table."""
    count = f"{summary.passed}/{summary.total}"
    return f"{count} (one flight)" if summary.flown < summary.total else count


def metres(value: float | None, digits: int = 4) -> str:
    """A length ``value`` [m] for a table."""
    return "–" if value is None else f"{value:.{digits}f}"


def millimetres(value: float | None) -> str:
    """A margin ``value`` [m] for a table, in millimetres and with its sign."""
    return "–" if value is None else f"{1000.0 * value:+.1f}"


def interval(summary: Summary) -> str:
    """Wilson's interval for a table."""
    return f"{summary.wilson_low:.2f}–{summary.wilson_high:.2f}"
