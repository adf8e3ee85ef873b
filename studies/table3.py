"""Table III: horizon and lambda in Case II with disturbance."""

from __future__ import annotations

from studies import deviations
from studies.campaign import Campaign
from studies.cases import configuration, scenario, with_horizon, with_lambda
from studies.job import Job
from studies.paper import TABLE_3
from studies.settings import Report, Settings, Table
from studies.summary import Cell, Summary, fly_cells, interval, metres, millimetres, seen

HORIZONS = (1, 5, 10)
PAPER_LAMBDAS = (1.0, 5.0)

_HEADERS = (
    "n",
    "λ",
    "passed",
    "95 %",
    "worst margin mm",
    "T_C ms",
    "TE m",
    "c_s",
    "c_e",
    "paper T_C ms",
    "paper TE m",
    "paper c_s",
    "paper c_e",
)


def run(settings: Settings, campaign: Campaign) -> Report:
    """Fly the table."""
    flown = scenario("II", disturbed=True, duration_s=settings.duration_s)
    ours = configuration(settings.plant, "blf", settings.inner)
    lambdas = (*PAPER_LAMBDAS, ours.planner.workspace.lambda_)
    columns = [(horizon, value) for horizon in HORIZONS for value in lambdas]
    cells = [
        Cell(
            tuple(
                Job(settings.plant, flown, with_horizon(with_lambda(ours, value), horizon), seed)
                for seed in settings.seeds
            )
        )
        for horizon, value in columns
    ]
    summaries, errors = fly_cells(campaign, cells)
    found = list(zip(columns, summaries, strict=True))
    return Report(
        title=f"Table III, {settings.plant} plant",
        rows=[
            {
                "plant": settings.plant,
                "horizon": horizon,
                "lambda": value,
                "ours": value not in PAPER_LAMBDAS,
                "tc_s": 1e-6 * summary.tc_p50_us,
                **summary.as_json(),
                **_printed(horizon, value),
            }
            for (horizon, value), summary in found
        ],
        tables=(
            Table(
                "Case II, with disturbance",
                _HEADERS,
                tuple(_cells(horizon, value, row) for (horizon, value), row in found),
            ),
        ),
        deviations=deviations.TABLE_3 + deviations.PLANT[settings.plant],
        errors=errors,
    )


def _printed(horizon: int, value: float) -> dict[str, float | None]:
    printed = TABLE_3.get((horizon, value))
    return {
        "paper_tc_s": None if printed is None else printed.tc_s,
        "paper_te_m": None if printed is None else printed.te_m,
        "paper_cs": None if printed is None else printed.cs,
        "paper_ce": None if printed is None else printed.ce,
    }


def _cells(horizon: int, value: float, summary: Summary) -> tuple[str, ...]:
    printed = TABLE_3.get((horizon, value))
    theirs = ("–",) * 4
    if printed is not None:
        theirs = (
            f"{1000.0 * printed.tc_s:.1f}",
            f"{printed.te_m:.4f}",
            f"{printed.cs:.4f}",
            f"{printed.ce:.4f}",
        )
    return (
        str(horizon),
        f"{value:g}" if value in PAPER_LAMBDAS else f"{value:g} (ours)",
        seen(summary),
        interval(summary),
        millimetres(summary.worst_margin_m),
        f"{1e-3 * summary.tc_p50_us:.2f}",
        metres(summary.te_m),
        f"{summary.cs_mean:.4f}",
        f"{summary.ce_mean:.4f}",
        *theirs,
    )
