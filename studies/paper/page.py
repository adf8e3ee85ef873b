"""A study written down: a self-contained HTML page, its drawings and its numbers."""

from __future__ import annotations

import html
from pathlib import Path

from command_line.html_page import document, items, table
from command_line.output import json_text
from studies.paper.settings import Figure, Report, Settings


def write(
    report: Report, settings: Settings, provenance: tuple[str, ...], name: str, folder: Path
) -> Path:
    """Write page, rows, drawings and numbers into a folder, under the study's name; the page."""
    folder.mkdir(parents=True, exist_ok=True)
    written = folder / f"{name}.html"
    written.write_text(page(report, settings, provenance), encoding="utf-8")
    (folder / f"{name}-rows.json").write_text(rows_text(report), encoding="utf-8")
    (folder / f"{name}.md").write_text(markdown(report), encoding="utf-8")
    for figure in report.figures:
        (folder / f"{figure.name}.svg").write_text(figure.svg, encoding="utf-8")
        arrays = json_text(figure.arrays)
        (folder / f"{figure.name}.json").write_text(arrays + "\n", encoding="utf-8")
    return written


def rows_text(report: Report) -> str:
    """The rows as JSON text; a number that does not exist is null."""
    return json_text(report.rows, 1) + "\n"


def markdown(report: Report) -> str:
    """The tables as Markdown, for the documentation."""
    return "\n".join(
        "\n".join(
            (
                f"### {table.caption}\n",
                *(
                    f"| {' | '.join(row)} |"
                    for row in (table.headers, ("---",) * len(table.headers))
                ),
                *(f"| {' | '.join(row)} |" for row in table.rows),
                "",
            )
        )
        for table in report.tables
    )


def page(report: Report, settings: Settings, provenance: tuple[str, ...]) -> str:
    """The page of one study; provenance says in sentences how to get the same again."""
    parts = [f"<h1>{html.escape(report.title)}</h1>", items(provenance), _seeds(settings)]
    parts += [table(one.headers, one.rows, one.caption) for one in report.tables]
    parts += [_figure(figure) for figure in report.figures]
    if report.errors:
        parts.append('<h2 class="warning">Flights that broke</h2>' + items(report.errors))
    if report.deviations:
        parts.append("<h2>Deviations from the paper</h2>" + items(report.deviations))
    return document(report.title, parts)


def _seeds(settings: Settings) -> str:
    first, last = settings.seeds[0], settings.seeds[-1]
    asked = f"Reported seeds: {first} to {last}. Seeds 0 to 29 were used for tuning."
    if not settings.tuned_on:
        return f"<p>{asked} The two are disjoint.</p>"
    return (
        f'<p class="warning">{asked} {len(settings.tuned_on)} of the seeds here are among them: '
        "these flights show how well the tuning fits, not how well it carries over.</p>"
    )


def _figure(figure: Figure) -> str:
    drawing = figure.svg[figure.svg.index("<svg") :]  # no XML declaration inside HTML
    caption = f"{figure.caption} (numbers: {figure.name}.json)"
    return f"<figure>{drawing}<figcaption>{html.escape(caption)}</figcaption></figure>"
