"""The report as one HTML file: verdict, tables, figures, and the library that draws them."""

from __future__ import annotations

import base64
import gzip
import html
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

from command_line.html_page import document, table
from command_line.output import json_text, listed
from view.report.chart import Chart
from view.report.charts import charts, worst_sentence
from view.report.provenance import provenance
from view.report.reported import Reported

_HERE: Final = Path(__file__).parent
# Nothing is loaded and nothing is sent; Plotly builds its shaders by `new Function`.
_POLICY: Final = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:"
)
_PAIR: Final = 2  # flights of which the second is compared with the first
_NAMED: Final = 10  # files that could not be written
# A number with its unit, and perhaps the limit that both flights share, or the part that it is of.
_NUMBER: Final = re.compile(
    r"(?P<number>-?\d+(?:\.(?P<digits>\d+))?)(?: of -?[\d.]+)?(?P<unit>(?: [^\d,]*)?|%)"
    r"(?:, [\w/]+)?"
)
Rows = Sequence[tuple[str, str]]


def page(flights: Sequence[Reported], summaries: Mapping[str, Rows]) -> str:
    """The page of flights; ``summaries`` are the rows of each one's result table, by label."""
    title = "Flight report: " + ", ".join(dict.fromkeys(flight.label for flight in flights))
    figures = charts(flights)
    head = f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
    parts = [
        f"<header><h1>{html.escape(title)}</h1>",
        *(_verdict(flight, alone=len(flights) == 1) for flight in flights),
        "</header>",
        _navigation(figures),
        "<noscript><p class=warning>The figures need JavaScript, the tables do not.</p></noscript>",
        f'<section class="long pair{" several" * (len(flights) > 1)}">',
        _summary(flights, summaries),
        '<div class="provenance">' + provenance(flights) + "</div>",
        "</section>",
        *(_figure(chart) for chart in figures),
        *(_events(flight, alone=len(flights) == 1) for flight in flights),
        _data("figures", json_text([_plain(chart) for chart in figures])),
        f'<script type="text/plain" id="plotly">{_library()}</script>',
        f"<script>{(_HERE / 'report.js').read_text(encoding='utf-8')}</script>",
    ]
    return document(title, parts, (_HERE / "report.css").read_text(encoding="utf-8"), head)


def _plain(chart: Chart) -> dict[str, Any]:
    of_time = "start" in str(chart.layout.get("xaxis", {}).get("title", {}).get("text", ""))
    return {
        "name": chart.name, "data": chart.data, "layout": chart.layout,
        "xaxisOfTime": of_time and chart.name != "worst_second",
    }  # fmt: skip


def _data(name: str, text: str) -> str:
    """JSON that a page can hold: no text in it can end the element."""
    escaped = text.replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{escaped}</script>'


@cache
def _library() -> str:
    """Plotly's library for browsers, compressed: 2.0 MB in place of 4.8."""
    from importlib.resources import files

    source = files("plotly").joinpath("package_data", "plotly.min.js").read_bytes()
    return base64.b64encode(gzip.compress(source, 9, mtime=0)).decode("ascii")


def _verdict(flight: Reported, *, alone: bool) -> str:
    words = {True: ("PASS", "pass"), False: ("FAIL", "fail"), None: ("NO RESULT", "unknown")}
    word, kind = words[flight.result.get("completed")]
    reason = flight.result.get("end_reason") or "no result.json beside the log"
    cut = f" The log {flight.data.cut}." if flight.data.cut else ""
    missing = listed([*map(str, flight.result.get("unwritten", ()))], _NAMED)
    unwritten = f" Not written: {missing}." if missing else ""
    lost = f" {flight.data.lost_ms} ms are missing in the log." if flight.data.lost_ms else ""
    named = "" if alone else f"<strong>{html.escape(flight.label)}</strong>"
    sentence = f"{reason[:1].upper()}{reason[1:]}. {worst_sentence(flight)}{cut}{lost}{unwritten}"
    return (
        f'<p class="verdict"><span class="badge {kind}">{word}</span>{named}'
        f"<span>{html.escape(sentence)}</span></p>"
    )


def _navigation(figures: Sequence[Chart]) -> str:
    links = "".join(f'<a href="#{c.name}-title">{html.escape(c.title)}</a>' for c in figures)
    return f"<nav>{links}</nav>"


def _summary(flights: Sequence[Reported], summaries: Mapping[str, Rows]) -> str:
    """A row a figure, a column a flight."""
    names = dict.fromkeys(name for rows in summaries.values() for name, _ in rows)
    found = {label: dict(rows) for label, rows in summaries.items()}
    rows = [[name, *(found[f.label].get(name, "") for f in flights)] for name in names]
    heads = ["", *(flight.label if len(flights) > 1 else "" for flight in flights)]
    if len(flights) == _PAIR:
        heads.append("difference")
        rows = [[*row, difference(row[1], row[2])] for row in rows]
    return table(heads, rows, "Result") if rows else ""


def difference(one: str, other: str) -> str:
    """The second number minus the first, in their unit; of several behind slashes, of each.

    Empty where they are not alike.
    """
    pairs = list(zip(one.split(" / "), other.split(" / "), strict=False))
    changes = [_change(*pair) for pair in pairs]
    alike = one.count(" / ") == other.count(" / ") and all(changes)
    return " / ".join(changes) if alike else ""


def _change(one: str, other: str) -> str:
    before, after = (_NUMBER.fullmatch(cell.strip()) for cell in (one, other))
    if before is None or after is None or before["unit"] != after["unit"]:
        return ""
    digits = max(len(each["digits"] or "") for each in (before, after))
    change = float(after["number"]) - float(before["number"])
    return f"{change:+.{digits}f} {before['unit'].strip()}".strip()


def _figure(chart: Chart) -> str:
    title, note = html.escape(chart.title), html.escape(chart.note)
    return (
        f'<section><h2 id="{chart.name}-title">{title}</h2><figure><figcaption>{note} '
        f'<button class="numbers" data-figure="{chart.name}">numbers as JSON</button> '
        f'<button class="numbers" data-svg="{chart.name}">SVG</button> '
        f'<button class="numbers" data-pdf="{chart.name}">PDF</button></figcaption>'
        f'<div class="chart" id="{chart.name}" style="height:{chart.layout["height"]}px"></div>'
        "</figure></section>"
    )


def _events(flight: Reported, *, alone: bool) -> str:
    """Everything that happened, with the numbers that the axes show."""
    if not flight.events:
        return ""
    rows = [
        (str(k), f"{event.t - flight.data.begin:.3f}", event.kind.value, event.text)
        for k, event in enumerate(flight.events, start=1)
    ]
    listed = table(("#", "time [s]", "kind", "what"), rows).replace(
        "<table>", '<table class="events">', 1
    )
    heading = "Events" if alone else f"Events of {flight.label}"
    return f'<section class="long"><h2>{html.escape(heading)}</h2>{listed}</section>'
