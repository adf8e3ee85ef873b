"""Table IV: four controllers, two cases, with and without disturbance, and their fair rivals."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from sitl.scenario import Scenario
from studies.campaign.campaign import Campaign
from studies.flight.job import Outcome
from studies.paper import published, summary
from studies.paper.cases import (
    CASES,
    Case,
    Entrant,
    Family,
    entrants,
    own_entrant,
    reference_floor_m,
)
from studies.paper.deviations import deviations
from studies.paper.settings import Report, Settings, Table
from studies.paper.summary import Summary, fly_cells
from studies.table_text import metres

_HEADERS = ("case", "controller", *summary.HEADERS, "c_s", "c_e", "paper", *published.HEADERS)


@dataclass(frozen=True, slots=True)
class _Entry:
    case: Case
    disturbed: bool
    entrant: Entrant
    flown: Scenario

    @property
    def printed(self) -> published.Completion | None:
        """What the paper has for it."""
        return published.TABLE_4.get((self.entrant.name, self.case, self.disturbed))


def run(settings: Settings, campaign: Campaign[Outcome]) -> Report:
    """Fly the table."""
    entries = [
        _Entry(case, disturbed, entrant, settings.flown(case, disturbed=disturbed))
        for disturbed in (False, True)
        for case in CASES
        for entrant in (
            *entrants(case, settings.plant, settings.inner, settings.family),
            *own_entrant(
                settings.plant, settings.inner, settings.own_planner, settings.own_controller
            ),
        )
    ]
    cells = [(entry.flown, entry.entrant.config) for entry in entries]
    summaries, errors = fly_cells(campaign, settings, cells)
    pairs = list(zip(entries, summaries, strict=True))
    return Report(
        title=f"Table IV, scenarios of {settings.family}, {settings.plant} plant",
        rows=[_row(settings, entry, row) for entry, row in pairs],
        tables=tuple(
            _table(pairs, comparison, disturbed)
            for comparison in ("paper", "like-for-like")
            for disturbed in (False, True)
        )
        + (_floors(settings),),
        deviations=deviations("both-tables", "table4", *_of(settings.family), settings.plant),
        errors=errors,
    )


def _of(family: Family) -> tuple[str, ...]:
    return () if family == "walls" else (family,)


def _row(settings: Settings, entry: _Entry, row: Summary) -> dict[str, Any]:
    return {
        "plant": settings.plant,
        "scenario": entry.flown.name,
        "case": entry.case,
        "disturbance": entry.disturbed,
        "controller": entry.entrant.name,
        "comparison": entry.entrant.comparison,
        **asdict(row),
        "te_floor_m": reference_floor_m(entry.flown),
        **published.as_json(published.Completion, entry.printed),
    }


def _table(pairs: list[tuple[_Entry, Summary]], comparison: str, disturbed: bool) -> Table:
    air = "with disturbance" if disturbed else "without disturbance"
    chosen = [
        (entry, row)
        for entry, row in pairs
        if entry.entrant.comparison == comparison and entry.disturbed == disturbed
    ]
    return Table(
        f"{comparison.capitalize()} comparison, {air}",
        _HEADERS,
        tuple(_cells(entry, row) for entry, row in chosen),
    )


def _floors(settings: Settings) -> Table:
    floors = [(case, reference_floor_m(settings.flown(case, disturbed=False))) for case in CASES]
    return Table(
        "Minimum TE of any safe controller: RMS distance of the reference from the safe set",
        ("case", "TE m"),
        tuple((case, metres(floor)) for case, floor in floors),
    )


def _cells(entry: _Entry, row: Summary) -> tuple[str, ...]:
    printed = entry.printed
    return (
        entry.case,
        entry.entrant.name,
        *summary.cells(row),
        f"{row.cs_mean:.4f}",
        f"{row.ce_mean:.4f}",
        "–" if printed is None else "✓" if printed.completed else "×",
        *published.cells(printed),
    )
