"""Table III: horizon and lambda in Case II with disturbance."""

from __future__ import annotations

from dataclasses import asdict

from studies.campaign.campaign import Campaign
from studies.flight.job import Outcome
from studies.paper import published, summary
from studies.paper.cases import configuration, scenario, with_horizon, with_lambda
from studies.paper.deviations import deviations
from studies.paper.settings import Report, Settings, Table
from studies.paper.summary import Summary, fly_cells

HORIZONS = (1, 5, 10)
PAPER_LAMBDAS = (1.0, 5.0)

_HEADERS = ("n", "λ", *summary.HEADERS, "c_s", "c_e", "T_C ms", *published.HEADERS, "paper T_C ms")


def run(settings: Settings, campaign: Campaign[Outcome]) -> Report:
    """Fly the table."""
    flown = scenario("II", disturbed=True, duration_s=settings.duration_s)
    ours = configuration(settings.plant, "blf", settings.inner)
    lambdas = (*PAPER_LAMBDAS, ours.planner.workspace.lambda_)
    columns = [(horizon, value) for horizon in HORIZONS for value in lambdas]
    configs = [with_horizon(with_lambda(ours, value), horizon) for horizon, value in columns]
    summaries, errors = fly_cells(campaign, settings, [(flown, config) for config in configs])
    found = list(zip(columns, summaries, strict=True))
    return Report(
        title=f"Table III, {settings.plant} plant",
        rows=[
            {
                "plant": settings.plant,
                "horizon": horizon,
                "lambda": value,
                "ours": value not in PAPER_LAMBDAS,
                "tc_s": 1e-6 * row.tc_p50_us,
                **asdict(row),
                **published.as_json(published.Ablation, published.TABLE_3.get((horizon, value))),
            }
            for (horizon, value), row in found
        ],
        tables=(
            Table(
                "Case II, with disturbance",
                _HEADERS,
                tuple(_cells(horizon, value, row) for (horizon, value), row in found),
            ),
        ),
        deviations=deviations("both-tables", "table3", settings.plant),
        errors=errors,
    )


def _cells(horizon: int, value: float, row: Summary) -> tuple[str, ...]:
    printed = published.TABLE_3.get((horizon, value))
    return (
        str(horizon),
        f"{value:g}" if value in PAPER_LAMBDAS else f"{value:g} (ours)",
        *summary.cells(row),
        f"{row.cs_mean:.4f}",
        f"{row.ce_mean:.4f}",
        f"{1e-3 * row.tc_p50_us:.2f}",
        *published.cells(printed),
        "–" if printed is None else f"{1000.0 * printed.tc_s:.1f}",
    )
