"""The smallest workspace sphere in which MPC-BLF still passes every seed of Case II."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from sitl.scenario import Scenario
from studies import deviations
from studies.campaign import Campaign
from studies.cases import configuration, scenario
from studies.job import Job
from studies.settings import Report, Settings, Table
from studies.summary import Cell, Summary, fly_cells, interval, metres, millimetres, seen

RADII_M = (0.075, 0.070, 0.065, 0.060, 0.055, 0.050, 0.045, 0.040, 0.035, 0.030)

_HEADERS = ("r m", "passed", "95 %", "worst margin mm", "TE m")


def run(settings: Settings, campaign: Campaign) -> Report:
    """Shrink the sphere until a seed fails."""
    config = configuration(settings.plant, "blf", settings.inner)
    flown = scenario("II", disturbed=True, duration_s=settings.duration_s)
    found: list[tuple[float, Summary]] = []
    errors: tuple[str, ...] = ()
    for radius in RADII_M:
        smaller = with_radius(flown, radius)
        jobs = tuple(Job(settings.plant, smaller, config, seed) for seed in settings.seeds)
        (summary,), broke = fly_cells(campaign, [Cell(jobs)])
        found.append((radius, summary))
        errors += broke
        if summary.passed < summary.total:
            break
    return Report(
        title=f"Smallest workspace sphere of MPC-BLF, {settings.plant} plant",
        rows=[_row(settings, radius, summary) for radius, summary in found],
        tables=(
            Table(
                "Case II with disturbance, until the first seed fails",
                _HEADERS,
                tuple(
                    (
                        f"{radius:.3f}",
                        seen(row),
                        interval(row),
                        millimetres(row.worst_margin_m),
                        metres(row.te_m),
                    )
                    for radius, row in found
                ),
            ),
        ),
        deviations=deviations.SPHERE,
        errors=errors,
    )


def with_radius(flown: Scenario, radius_m: float) -> Scenario:
    """The scenario with another workspace sphere."""
    assert flown.workspace is not None
    return replace(flown, workspace=replace(flown.workspace, radius_m=radius_m))


def _row(settings: Settings, radius: float, summary: Summary) -> dict[str, Any]:
    head = {"plant": settings.plant, "case": "II", "controller": "blf", "radius_m": radius}
    return head | summary.as_json()
