"""Write a study down: one page, the drawings, and their numbers beside them."""

from __future__ import annotations

import json
from pathlib import Path

from studies.page import page
from studies.settings import Report, Settings


def write(
    report: Report, settings: Settings, provenance: tuple[str, ...], name: str, folder: Path
) -> Path:
    """Write everything into a folder; returns the page.

    Args:
        report: What was found.
        settings: What was asked for.
        provenance: For the page.
        name: Of the study, and of its files.
        folder: Made if it is not there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = folder / f"{name}.html"
    written.write_text(page(report, settings, provenance), encoding="utf-8")
    write_json(report, folder / f"{name}-rows.json")
    for figure in report.figures:
        (folder / f"{figure.name}.svg").write_text(figure.svg, encoding="utf-8")
        arrays = json.dumps(figure.arrays, separators=(",", ":"))
        (folder / f"{figure.name}.json").write_text(arrays + "\n", encoding="utf-8")
    return written


def write_json(report: Report, path: Path) -> None:
    """The rows as a list, for machines."""
    path.write_text(json_text(report), encoding="utf-8")


def json_text(report: Report) -> str:
    """The rows as JSON text; a number that does not exist is null."""
    return json.dumps(report.rows, indent=1, allow_nan=False) + "\n"
