"""Every controller at its best: margin against tracking error, each with the settings it has.

A rival is looked for by its own settings: HC by its tightening, hard and softened, with longer
horizons and with a terminal set; SC by its weights; Naive by its centring, where there is a centre;
BLF by lambda. What is found is on nobody's side: each setting is a point, and those that no other
point of any family beats in both margin and error are the front.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

from fsw.autopilot.parameters.flight_config import FlightConfig
from studies.campaign.campaign import Campaign
from studies.drawing import BOUND, sheet
from studies.flight.job import Outcome
from studies.paper.cases import (
    CASES,
    Case,
    configuration,
    softened,
    tightened,
    with_horizon,
    with_lambda,
)
from studies.paper.deviations import deviations
from studies.paper.settings import Figure, Report, Settings, Table
from studies.paper.summary import Summary, fly_cells

_TIGHTENINGS_MM = (0, 25, 50, 75, 100, 125, 150)
_COARSE_MM = (0, 50, 100, 150)  # where a planning step takes long, or little changes
_LAMBDAS = (0.1, 0.2, 0.25, 0.3, 0.35, 0.5)  # m/s
_SOFT = (1e-2, 1.0, 1e1, 1e2, 1e4)  # times the printed weight, which stands in a denominator
_CENTRING = (1.0, 10.0, 100.0, 1000.0)
_HORIZONS = (10, 20)
_DURATION_S = 20.0  # the first dash of Case I is at 15 s
_COLOURS = ("#8c959f", "#0969da", "#54aeff", "#8250df", "#bf3989", "#2da44e", "#cf222e")


@dataclass(frozen=True, slots=True)
class _Point:
    """One setting of one family."""

    case: Case
    family: str
    setting: str
    config: FlightConfig


def run(settings: Settings, campaign: Campaign[Outcome]) -> Report:
    """Fly every setting, calm and disturbed."""
    settings = replace(settings, duration_s=settings.duration_s or _DURATION_S)
    points = [point for case in CASES for point in _points(case, settings)]
    flown = {
        (case, air): settings.flown(case, disturbed=air) for case in CASES for air in (False, True)
    }
    cells = [(flown[point.case, air], point.config) for point in points for air in (False, True)]
    summaries, errors = fly_cells(campaign, settings, cells)
    found = list(zip(points, summaries[::2], summaries[1::2], strict=True))
    head = {"plant": settings.plant, "scenario": settings.family}
    return Report(
        title=f"Rivals at their best, scenarios of {settings.family}, {settings.plant} plant",
        rows=[
            {
                **head,
                "case": point.case,
                "family": point.family,
                "setting": point.setting,
                "disturbance": air,
                "on_front": point.setting in _front(found, point, air=air),
                **asdict(row),
            }
            for point, *rows in found
            for air, row in zip((False, True), rows, strict=True)
        ],
        tables=tuple(_table(case, found) for case in CASES),
        figures=(_figure(found),),
        deviations=deviations("both-tables", "rivals", settings.plant),
        errors=errors,
    )


_Found = list[tuple[_Point, Summary, Summary]]


def _points(case: Case, settings: Settings) -> Iterator[_Point]:
    naive, hc, sc, blf = (
        configuration(settings.plant, name, settings.inner) for name in ("naive", "hc", "sc", "blf")
    )
    yield _Point(case, "naive", "as printed", naive)
    if case == "II":
        for weight in _CENTRING:
            soft = replace(naive.planner.soft, centring=weight)
            planner = replace(naive.planner, centred=True, soft=soft)
            centred = replace(naive, planner=planner)
            yield _Point(case, "naive", f"centring {weight:g}", centred)
    soft_hc = softened(hc)
    ends_safe = replace(soft_hc, planner=replace(soft_hc.planner, hard_terminal=True))
    families = [
        ("hc", hc, _TIGHTENINGS_MM),
        ("hc softened", soft_hc, _TIGHTENINGS_MM),
        *((f"hc softened, n = {n}", with_horizon(soft_hc, n), _COARSE_MM) for n in _HORIZONS),
        ("hc softened, terminal set", ends_safe, _COARSE_MM),
    ]
    for name, config, tightenings in families:
        for more in tightenings:
            if case == "I" or more < _radius_mm(settings):
                yield _Point(case, name, f"+{more} mm", tightened(config, 1e-3 * max(more, 1)))
    for times in _SOFT:
        yield _Point(case, "sc", f"weights x {times:g}", _with_weights(sc, times))
    for lambda_ in _LAMBDAS:
        yield _Point(case, "blf", f"lambda {lambda_:g}", with_lambda(blf, lambda_))


def _radius_mm(settings: Settings) -> float:
    """Of the sphere of Case II: to keep more than that from its surface is to be nowhere."""
    workspace = settings.flown("II", disturbed=False).workspace
    assert workspace is not None
    return 1e3 * workspace.radius_m


def _with_weights(sc: FlightConfig, times: float) -> FlightConfig:
    soft = sc.planner.soft
    changed = replace(
        soft,
        wall=times * soft.wall,
        wall_terminal=times * soft.wall_terminal,
        workspace=times * soft.workspace,
        workspace_terminal=times * soft.workspace_terminal,
    )
    return replace(sc, planner=replace(sc.planner, soft=changed))


def _margin(row: Summary) -> float:
    return -1.0 if row.worst_margin_m is None else row.worst_margin_m


def _front(found: _Found, like: _Point, *, air: bool) -> set[str]:
    """Settings of a point's family that no setting of the case beats in margin and in error.

    Of flights that were all completed: an error of one that ended early says nothing.
    """
    rows = [
        (point, (calm, disturbed)[air])
        for point, calm, disturbed in found
        if point.case == like.case
    ]
    whole = [(point, row) for point, row in rows if row.passed == row.total and row.te_m]
    return {
        point.setting
        for point, row in whole
        if point.family == like.family
        and not any(_beats(other, row) for _, other in whole if other is not row)
    }


def _beats(one: Summary, other: Summary) -> bool:
    closer = (one.te_m or 0.0) <= (other.te_m or 0.0)
    return closer and _margin(one) > _margin(other)


def _table(case: Case, found: _Found) -> Table:
    headers = ("passed", "worst margin mm", "TE mm")
    return Table(
        f"Case {case}: margin over all seeds and mean TE, calm and disturbed; * is on the front",
        ("family", "setting", *headers, *(f"{name}, disturbed" for name in headers)),
        tuple(
            (
                point.family,
                point.setting,
                *_cells(calm, front=point.setting in _front(found, point, air=False)),
                *_cells(disturbed, front=point.setting in _front(found, point, air=True)),
            )
            for point, calm, disturbed in found
            if point.case == case
        ),
    )


def _cells(row: Summary, *, front: bool) -> tuple[str, str, str]:
    passed = "1/1" if row.flown < row.total and row.passed else f"{row.passed}/{row.total}"
    te = "–" if row.te_m is None else f"{1e3 * row.te_m:.1f}"
    return passed + ("*" if front else ""), f"{1e3 * _margin(row):+.1f}", te


def _figure(found: _Found) -> Figure:
    caption = (
        "Worst margin against mean TE: filled where every flight was completed. "
        "Left calm, right disturbed; above Case I, below Case II"
    )
    drawn, names = sheet(2, 2, 10.0, 8.0), list(dict.fromkeys(point.family for point, *_ in found))
    arrays: dict[str, dict[str, list[float]]] = {}
    for line, case in zip(drawn.axes, CASES, strict=True):
        for ax, air in zip(line, (False, True), strict=True):
            for name, colour in zip(names, _COLOURS + (BOUND,), strict=False):
                rows = [
                    pair[air]
                    for point, *pair in found
                    if (point.case, point.family) == (case, name)
                ]
                te = [1e3 * (row.te_m or 0.0) for row in rows]
                margin = [1e3 * max(_margin(row), -0.12) for row in rows]
                whole = [row.passed == row.total for row in rows]
                ax.plot(te, margin, "-", color=colour, linewidth=0.7, alpha=0.6)
                for x, y, filled in zip(te, margin, whole, strict=True):
                    ax.plot(x, y, "o", color=colour, ms=4.0, mfc=colour if filled else "none")
                ax.plot([], [], "o-", color=colour, ms=4.0, label=name)
                key = f"{name}, case {case}, {'disturbed' if air else 'calm'}"
                arrays[key] = {"te_mm": te, "margin_mm": margin}
            ax.axhline(0.0, color="#cf222e", linewidth=0.8, linestyle="--")
            ax.set_xscale("log")
            ax.set_ylim(-125.0, 260.0)
            ax.set_xlabel("TE mm", fontsize=8)
            ax.set_ylabel("worst margin mm", fontsize=8)
            ax.set_title(f"Case {case}, {'disturbed' if air else 'calm'}", fontsize=9, loc="left")
    drawn.axes[0][0].legend(fontsize=7, frameon=False, loc="upper left")
    return Figure("rivals", caption, drawn.svg(), arrays)
