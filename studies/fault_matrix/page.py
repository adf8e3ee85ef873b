"""The matrix of modes and faults as a self-contained HTML page."""

from __future__ import annotations

import html
from collections.abc import Sequence

from command_line.html_page import document, items
from studies.fault_matrix.matrix import Judged

_STYLE = """
td.good { background: #e6f4ea; } td.bad { background: #fce8e6; }
td, th { vertical-align: top; text-align: left !important; font-size: 12px; }
"""


def page(rows: Sequence[Judged], provenance: Sequence[str]) -> str:
    """Faults down, modes across; a cell says when it was told, what followed, the margin."""
    modes = list(dict.fromkeys(row.cell.mode for row in rows))
    faults = list(dict.fromkeys(row.cell.expected.name for row in rows))
    cells: dict[tuple[str, str], list[Judged]] = {}
    for row in rows:
        cells.setdefault((row.cell.expected.name, row.cell.mode), []).append(row)
    wrong = sum(1 for row in rows if row.differs)
    title = "Faults in every mode"
    head = "".join(f"<th>{html.escape(mode)}</th>" for mode in modes)
    body = "\n".join(
        f"<tr><th>{html.escape(fault)}</th>"
        + "".join(_cell(cells.get((fault, mode), [])) for mode in modes)
        + "</tr>"
        for fault in faults
    )
    sentences = (*provenance, f"{len(rows)} cells, {wrong} not as they must be.")
    return document(
        title,
        (
            f"<h1>{title}</h1>",
            items(sentences),
            f"<table><thead><tr><th>fault</th>{head}</tr></thead>\n<tbody>{body}</tbody></table>",
        ),
        _STYLE,
    )


def _cell(rows: Sequence[Judged]) -> str:
    """All seeds of a cell."""
    if not rows:
        return "<td></td>"
    lines = [line for row in rows for line in (summary(row), *row.differs, *row.known)]
    text = "<br>".join(html.escape(line) for line in lines if line)
    warning = rows[0].flight.warning
    title = "" if warning is None else html.escape(warning.text, quote=True)
    bad = any(row.differs for row in rows)
    return f'<td class="{"bad" if bad else "good"}" title="{title}">{text}</td>'


def summary(row: Judged) -> str:
    """When it was told, what was done, and the least margin."""
    flight = row.flight
    told = "silent" if flight.warning is None else f"{flight.warning.after_s:.2f} s"
    margin = "" if flight.least_m is None else f", {1000.0 * flight.least_m:.0f} mm"
    return f"{told}, {', then '.join(flight.actions) or 'goes on'}{margin}"
