"""The smallest workspace sphere in which MPC-BLF still passes every seed of Case II."""

from __future__ import annotations

from dataclasses import asdict, replace

from studies.campaign.campaign import Campaign
from studies.flight.job import Outcome
from studies.paper import summary
from studies.paper.cases import configuration, scenario
from studies.paper.deviations import deviations
from studies.paper.settings import Report, Settings, Table
from studies.paper.summary import Summary, fly_cells

RADII_M = (0.075, 0.070, 0.065, 0.060, 0.055, 0.050, 0.045, 0.040, 0.035, 0.030)


def run(settings: Settings, campaign: Campaign[Outcome]) -> Report:
    """Shrink the sphere until a seed fails."""
    config = configuration(settings.plant, "blf", settings.inner)
    flown = scenario("II", disturbed=True, duration_s=settings.duration_s)
    found: list[tuple[float, Summary]] = []
    errors: tuple[str, ...] = ()
    assert flown.workspace is not None
    for radius in RADII_M:
        smaller = replace(flown, workspace=replace(flown.workspace, radius_m=radius))
        (row,), broke = fly_cells(campaign, settings, [(smaller, config)])
        found.append((radius, row))
        errors += broke
        if row.passed < row.total:
            break
    head = {"plant": settings.plant, "case": "II", "controller": "blf"}
    return Report(
        title=f"Smallest workspace sphere of MPC-BLF, {settings.plant} plant",
        rows=[{**head, "radius_m": radius, **asdict(row)} for radius, row in found],
        tables=(
            Table(
                "Case II with disturbance, until the first seed fails",
                ("r m", *summary.HEADERS),
                tuple((f"{radius:.3f}", *summary.cells(row)) for radius, row in found),
            ),
        ),
        deviations=deviations("smallest-sphere"),
        errors=errors,
    )
