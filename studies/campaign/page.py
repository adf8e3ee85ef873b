"""A campaign as a self-contained page: distributions, maps of what varied, the worst flights."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from command_line.html_page import document, items, table
from command_line.html_page import verdict as html_verdict
from studies.campaign.flight import CampaignRow
from studies.campaign.store import CampaignResult
from studies.campaign.summary import CaseSummary, summaries, verdict, worst
from studies.drawing import BASE, BOUND, WALL, NoMatplotlibError, drawable, sheet
from studies.table_text import error_mm, millimetres

_MAX_CASES: Final = 12  # that are drawn
_MAX_POINTS: Final = 4000  # of a map
_MAX_MAPS: Final = 8
_CASE: Final = ("scenario", "sensors", "controller", "fault")


def page(
    result: CampaignResult,
    sentences: Sequence[str],
    where: Path,
    required: Sequence[tuple[bool, str]] = (),
) -> str:
    """The page of the campaign in a directory; of what was ``required``, whether it is met."""
    rows, plan = result.rows, result.plan
    title = f"Campaign {plan.name}"
    verdicts = required or (verdict(rows, result.asked),)
    parts = [f"<h1>{html.escape(title)}</h1>", *(html_verdict(*one) for one in verdicts)]
    parts.append(items(_facts(result, sentences)))
    parts += ["<h2>What varied</h2>", items([str(one) for one in plan.varied] or ["nothing"])]
    parts.append(_cases(summaries(rows)))
    parts.append(_worst(worst(rows), where))
    broken = [row for row in rows if row.error]
    if broken:
        texts = [f"flight {row.flight}: {row.reason}" for row in broken[:100]]
        parts.append('<h2 class="warning">Flights that broke</h2>' + items(texts))
    try:
        parts += _figures(result)
    except NoMatplotlibError as error:
        parts.append(f"<p>No figures: {html.escape(str(error))}</p>")
    return document(title, parts)


def _facts(result: CampaignResult, sentences: Sequence[str]) -> list[str]:
    plan, digests = result.plan, result.digests
    return [
        f"{len(result.rows)} of {result.asked} flights, {plan.design} design, root seed "
        f"{plan.seed}",
        *sentences,
        f"digests: plan {digests.plan[:12]}, code {digests.code[:12]}, packages "
        f"{digests.packages[:12]}; whole in campaign.json",
    ]


def _cases(found: Sequence[CaseSummary]) -> str:
    headers = (
        *_CASE,
        "flights",
        "completed",
        "violations",
        "contacts",
        "refused",
        "broke",
        "minimum margin mm",
        "1 %",
        "median",
        "TE mm, median",
        "TE mm, 99 %",
    )
    lines = [
        (
            one.scenario,
            one.suite,
            one.controller,
            one.fault or "–",
            *(str(n) for n in (one.flights, one.completed, one.violated, one.contacts)),
            *(str(n) for n in (one.refused, one.errors)),
            *(millimetres(one.margin_m.get(share)) for share in ("0", "0.01", "0.5")),
            *(error_mm(one.te_m.get(share)) for share in ("0.5", "0.99")),
        )
        for one in found
    ]
    return table(headers, lines, "Configurations")


def _worst(rows: Sequence[CampaignRow], where: Path) -> str:
    headers = ("flight", "configuration", "margin mm", "of", "at s", "TE mm", "varied")
    lines = [
        (
            str(row.flight),
            ", ".join(x for x in (row.scenario, row.suite, row.controller, row.fault) if x),
            millimetres(row.margin_m),
            row.margin_of or "–",
            "–" if row.margin_time_s is None else f"{row.margin_time_s:.2f}",
            error_mm(row.te_m),
            ", ".join(f"{key} {value:.4g}" for key, value in row.values.items()) or "–",
        )
        for row in rows
    ]
    words = html.escape("\n".join(again(row, where) for row in rows))
    return (
        table(headers, lines, f"The worst {len(rows)} flights")
        + "<p>Each is flown again, with its trace and what shows it in <code>pandion view</code>, "
        f"by:</p><pre>{words}</pre>"
    )


def again(row: CampaignRow, where: Path) -> str:
    """The command that flies a flight again and writes what it takes to see it."""
    return f"pandion campaign {where / 'campaign.toml'} --flight {row.flight}"


def _figures(result: CampaignResult) -> list[str]:
    flown = [row for row in result.rows if not row.error]
    return [
        _figure(_distributions(result), "Minimum margin [mm] and tracking error TE [mm]"),
        *_maps(flown, result),
    ]


def _distributions(result: CampaignResult) -> str:
    flown = ((name, [row for row in of if not row.error]) for name, of in result.by_case.items())
    cases = [(name, of) for name, of in flown if of][:_MAX_CASES]
    drawn = sheet(max(len(cases), 1), 2, 11.0, max(1.6 * len(cases), 1.6))
    for (left, right), (name, of) in zip(drawn.axes, cases, strict=False):
        margins = drawable(1e3 * row.margin_m for row in of if row.margin_m is not None)
        errors = drawable(1e3 * row.te_m for row in of if row.te_m is not None)
        left.hist(margins, bins=40, color=BASE)
        left.axvline(0.0, color=WALL, linewidth=1.0)
        right.hist(errors, bins=40, color=BOUND)
        left.set_title(f"{name}: margin", fontsize=8, loc="left")
        right.set_title("TE", fontsize=8, loc="left")
    return drawn.svg()


def _maps(rows: Sequence[CampaignRow], result: CampaignResult) -> list[str]:
    """For each varied key: the margins over it, violations marked."""
    keys = [one.key for one in result.plan.varied][:_MAX_MAPS]
    if not keys or not rows:
        return []
    some = rows[:: max(1, len(rows) // _MAX_POINTS)] if len(rows) > _MAX_POINTS else rows
    bad = [row for row in rows if row.violated]
    good = [row for row in some if not row.violated]
    lines = -(-len(keys) // 2)
    drawn = sheet(lines, 2, 11.0, 2.6 * lines)
    axes = [ax for line in drawn.axes for ax in line]
    for ax, key in zip(axes, keys, strict=False):
        # In points squared: seen where there are few, apart where there are many.
        seen = min(max(4000.0 / max(len(some), 1), 5.0), 30.0)
        for of, colour, size in ((good, BASE, seen), (bad, WALL, max(seen, 14.0))):
            there = [row for row in of if row.margin_m is not None and key in row.values]
            x = np.array([row.values[key] for row in there])
            y = np.array([1e3 * row.margin_m for row in there if row.margin_m is not None])
            ax.scatter(x, y, s=size, color=colour, linewidths=0.0, alpha=0.75, rasterized=False)
        ax.axhline(0.0, color=WALL, linewidth=0.8)
        ax.set_xlabel(key, fontsize=8)
        ax.set_ylabel("margin mm", fontsize=8)
    for ax in axes[len(keys) :]:
        ax.set_visible(False)
    caption = f"Minimum margin over what varied; {len(bad)} violations in red"
    return [_figure(drawn.svg(), caption), *_failures(rows, result, keys)]


def _failures(
    rows: Sequence[CampaignRow], result: CampaignResult, keys: Sequence[str]
) -> list[str]:
    """Share of violations over pairs of varied keys, where there are violations at all."""
    if len(keys) < 2 or not any(row.violated for row in rows):
        return []
    pairs = [(keys[0], other) for other in keys[1:5]]
    drawn = sheet(-(-len(pairs) // 2), 2, 11.0, 3.2 * -(-len(pairs) // 2))
    axes = [ax for line in drawn.axes for ax in line]
    for ax, (across, up) in zip(axes, pairs, strict=False):
        x, y = (np.array([row.values[key] for row in rows]) for key in (across, up))
        weight = np.array([float(row.violated) for row in rows])
        all_, x_edges, y_edges = np.histogram2d(x, y, bins=12)
        bad, _, _ = np.histogram2d(x, y, bins=(x_edges, y_edges), weights=weight)
        with np.errstate(invalid="ignore"):
            share = np.where(all_ > 0, bad / all_, np.nan)
        mesh = ax.pcolormesh(x_edges, y_edges, share.T, cmap="Reds", vmin=0.0, vmax=1.0)
        drawn.canvas.colorbar(mesh, ax=ax)
        ax.set_xlabel(across, fontsize=8)
        ax.set_ylabel(up, fontsize=8)
    for ax in axes[len(pairs) :]:
        ax.set_visible(False)
    return [_figure(drawn.svg(), "Share of flights with a violation")]


def _figure(svg: str, caption: str) -> str:
    drawing = svg[svg.index("<svg") :]  # no XML declaration inside HTML
    return f"<figure>{drawing}<figcaption>{html.escape(caption)}</figcaption></figure>"
