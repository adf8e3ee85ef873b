"""Table IV: four controllers, two cases, with and without disturbance, and their fair rivals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sitl.scenario import Scenario
from studies import deviations
from studies.campaign import Campaign
from studies.cases import CASES, Case, Entrant, entrants, reference_floor_m, scenario
from studies.job import Job
from studies.paper import TABLE_4
from studies.settings import Report, Settings, Table
from studies.summary import Cell, Summary, fly_cells, interval, metres, millimetres, seen

_HEADERS = (
    "case",
    "controller",
    "passed",
    "95 %",
    "worst margin mm",
    "TE m",
    "c_s",
    "c_e",
    "paper",
    "paper TE m",
    "paper c_s",
    "paper c_e",
)


@dataclass(frozen=True, slots=True)
class _Entry:
    case: Case
    disturbed: bool
    entrant: Entrant
    flown: Scenario


def run(settings: Settings, campaign: Campaign) -> Report:
    """Fly the table."""
    entries = [
        _Entry(
            case,
            disturbed,
            entrant,
            scenario(case, disturbed=disturbed, duration_s=settings.duration_s),
        )
        for disturbed in (False, True)
        for case in CASES
        for entrant in entrants(case, settings.plant, settings.inner)
    ]
    cells = [
        Cell(
            tuple(
                Job(settings.plant, entry.flown, entry.entrant.config, seed)
                for seed in settings.seeds
            )
        )
        for entry in entries
    ]
    summaries, errors = fly_cells(campaign, cells)
    pairs = list(zip(entries, summaries, strict=True))
    return Report(
        title=f"Table IV, {settings.plant} plant",
        rows=[_row(settings, entry, summary) for entry, summary in pairs],
        tables=tuple(
            _table(pairs, comparison, disturbed)
            for comparison in ("paper", "like-for-like")
            for disturbed in (False, True)
        )
        + (_floors(settings),),
        deviations=deviations.TABLE_4 + deviations.PLANT[settings.plant],
        errors=errors,
    )


def _row(settings: Settings, entry: _Entry, summary: Summary) -> dict[str, Any]:
    printed = TABLE_4.get((entry.entrant.name, entry.case, entry.disturbed))
    return {
        "plant": settings.plant,
        "case": entry.case,
        "disturbance": entry.disturbed,
        "controller": entry.entrant.name,
        "comparison": entry.entrant.comparison,
        **summary.as_json(),
        "te_floor_m": reference_floor_m(entry.flown),
        "paper_completed": None if printed is None else printed.completed,
        "paper_te_m": None if printed is None else printed.te_m,
        "paper_cs": None if printed is None else printed.cs,
        "paper_ce": None if printed is None else printed.ce,
    }


def _table(pairs: list[tuple[_Entry, Summary]], comparison: str, disturbed: bool) -> Table:
    air = "with disturbance" if disturbed else "without disturbance"
    chosen = [
        (entry, summary)
        for entry, summary in pairs
        if entry.entrant.comparison == comparison and entry.disturbed == disturbed
    ]
    return Table(
        f"{comparison.capitalize()} comparison, {air}",
        _HEADERS,
        tuple(_cells(entry, summary) for entry, summary in chosen),
    )


def _floors(settings: Settings) -> Table:
    floors = [
        (case, reference_floor_m(scenario(case, disturbed=False, duration_s=settings.duration_s)))
        for case in CASES
    ]
    return Table(
        "Least TE of any safe controller: RMS distance of the reference from the safe set",
        ("case", "TE m"),
        tuple((case, metres(floor)) for case, floor in floors),
    )


def _cells(entry: _Entry, summary: Summary) -> tuple[str, ...]:
    printed = TABLE_4.get((entry.entrant.name, entry.case, entry.disturbed))
    theirs = ("–",) * 4
    if printed is not None:
        mark = "✓" if printed.completed else "×"
        theirs = (mark, f"{printed.te_m:.4f}", f"{printed.cs:.4f}", f"{printed.ce:.4f}")
    return (
        entry.case,
        entry.entrant.name,
        seen(summary),
        interval(summary),
        millimetres(summary.worst_margin_m),
        metres(summary.te_m),
        f"{summary.cs_mean:.4f}",
        f"{summary.ce_mean:.4f}",
        *theirs,
    )
