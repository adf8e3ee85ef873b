"""Many flights of one cell, in numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from fsw.autopilot.parameters.flight_config import FlightConfig
from sitl.scenario import Scenario
from studies.campaign.campaign import Campaign
from studies.flight.job import Job, Outcome
from studies.paper.settings import Settings
from studies.table_text import degrees, metres, millimetres

HEADERS = ("passed", "95 %", "worst margin mm", "limits kept", "angle left deg", "TE m")


@dataclass(frozen=True, slots=True)
class Summary:
    """Averages over the flights of a cell, and the worst of what must not be averaged."""

    passed: int
    total: int
    flown: int  # distinct flights; 1 in calm air, where every seed flies the same
    te_m: float | None  # mean of the flights' TE
    te_worst_m: float | None
    worst_margin_m: float | None
    limits_kept: int  # flights without a broken limit
    angle_margin_deg: float | None  # least, to any limit; None on a plant without limits
    cs_mean: float  # per planning step
    ce_mean: float
    cs_sum: float  # over a flight, as the paper defines it
    ce_sum: float
    tc_p50_us: float
    tc_p99_us: float
    wilson_low: float  # of the distinct flights
    wilson_high: float
    planning_failures: int
    contacts: int  # flights that ended at a wall or on the ground
    reported: int  # flights in which a text named the sensor at fault
    text: str  # the most frequent such text
    modes: dict[str, int]  # that vehicles changed to by themselves, with the flights that did
    took_s: float  # processor time of the distinct flights


def fly_cells(
    campaign: Campaign[Outcome], settings: Settings, cells: Sequence[tuple[Scenario, FlightConfig]]
) -> tuple[list[Summary], tuple[str, ...]]:
    """Fly all cells of a table, one job a seed; the second value names flights that broke."""
    return fly_jobs(
        campaign,
        [
            [Job(settings.plant, flown, config, seed) for seed in settings.seeds]
            for flown, config in cells
        ],
    )


def fly_jobs(
    campaign: Campaign[Outcome], jobs: Sequence[Sequence[Job]]
) -> tuple[list[Summary], tuple[str, ...]]:
    """Fly the jobs of each cell; the second value names flights that broke."""
    outcomes = campaign.run([job for cell in jobs for job in cell])
    rows = iter(outcomes)
    summaries = [summarise(cell, [next(rows) for _ in cell]) for cell in jobs]
    errors = {f"seed {row.seed}: {row.reason}" for row in outcomes if row.error}
    return summaries, tuple(sorted(errors))


def summarise(jobs: Sequence[Job], outcomes: Sequence[Outcome]) -> Summary:
    """The numbers of one cell, from the outcome of each of its jobs."""
    total = len(outcomes)
    took_s = {job.key(): row.took_s for job, row in zip(jobs, outcomes, strict=True)}
    flown = len(took_s)
    passed = sum(row.completed for row in outcomes)
    # Unlike the normal approximation, Wilson's interval means something where all passed.
    low, high = binomtest(round(passed * flown / total), flown).proportion_ci(method="wilson")
    whole = [row for row in outcomes if not row.error]
    errors = [row.te_m for row in whole if row.te_m is not None]
    margins = [row.margin_m for row in whole if row.margin_m is not None]
    angles = [row.angle_margin_deg for row in whole if row.angle_margin_deg is not None]
    texts = [row.reported for row in whole if row.reported]

    def mean(field: Callable[[Outcome], float]) -> float:
        return float(np.mean([field(row) for row in whole])) if whole else 0.0

    return Summary(
        passed=passed,
        total=total,
        flown=flown,
        te_m=float(np.mean(errors)) if errors else None,
        te_worst_m=max(errors, default=None),
        worst_margin_m=min(margins, default=None),
        limits_kept=sum(row.limits_kept for row in whole),
        angle_margin_deg=min(angles, default=None),
        cs_mean=mean(lambda row: row.cs_mean),
        ce_mean=mean(lambda row: row.ce_mean),
        cs_sum=mean(lambda row: row.cs_sum),
        ce_sum=mean(lambda row: row.ce_sum),
        tc_p50_us=mean(lambda row: row.tc_p50_us),
        tc_p99_us=mean(lambda row: row.tc_p99_us),
        wilson_low=float(low),
        wilson_high=float(high),
        planning_failures=sum(row.failures for row in whole),
        contacts=sum(row.contact for row in whole),
        reported=len(texts),
        text=max(texts, key=texts.count, default=""),
        modes=dict(Counter(row.modes for row in whole if row.modes)),
        took_s=sum(took_s.values()),
    )


def cells(summary: Summary) -> tuple[str, ...]:
    """A summary for a table, under ``HEADERS``."""
    passed = f"{summary.passed}/{summary.total}"
    return (
        f"{passed} (one flight)" if summary.flown < summary.total else passed,
        f"{summary.wilson_low:.2f}–{summary.wilson_high:.2f}",
        millimetres(summary.worst_margin_m),
        "–" if summary.angle_margin_deg is None else f"{summary.limits_kept}/{summary.total}",
        degrees(summary.angle_margin_deg),
        metres(summary.te_m),
    )
