"""The flights of a campaign as tests of a suite, for a server of continuous integration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from command_line.junit import Case
from studies.campaign.flight import CampaignRow
from studies.campaign.store import CampaignResult
from studies.table_text import millimetres

_MOST: Final = 20_000  # flights; of more only those are listed that are not as they must be


def junit_cases(result: CampaignResult, required: Sequence[dict[str, Any]]) -> list[Case]:
    """A test a flight, and one for each thing that was ``required``, as it was judged."""
    names = [str(case) for case in result.plan.cases]
    every = len(result.rows) <= _MOST
    cases = [
        _case(names[row.flight % len(names)], row)
        for row in result.rows
        if every or not row.completed
    ]
    missing = result.asked - len(result.rows)
    if missing:
        cases.append(Case("campaign", "complete", error=f"{missing} flights have no row"))
    for one in required:
        failure = "" if one["met"] else one["found"]
        cases.append(Case("required", one["text"], failure=failure, output=one["found"]))
    return cases


def _case(name: str, row: CampaignRow) -> Case:
    failed = not (row.completed or row.error)
    margin = f"margin {millimetres(row.margin_m)} mm, seed {row.seed}"
    return Case(
        name,
        f"flight {row.flight}",
        row.took_s,
        failure=f"{row.reason} ({margin})" if failed else "",
        error=row.reason if row.error else "",
    )
