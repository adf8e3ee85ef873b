"""``pandion report``: one or several flights as a self-contained HTML page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.options import option, read
from command_line.output import print_error, say
from command_line.parser import COULD_NOT_START
from pandion.result import FlightReports, as_json, table_rows

if TYPE_CHECKING:
    from view.report.reported import Reported

WRITTEN: Final = 0  # exit code
NAME: Final = "report.html"
_MOST: Final = 7  # flights, as many as there are colours


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportOptions:
    """One page."""

    logs: list[Path] = option("LOG ...", "flight.ulg, or its directory", Path, required=True)
    html: Path | None = option(
        "--html FILE", "the page (default report.html beside the log)", Path, old="--out"
    )


def main(argv: list[str]) -> int:
    """Write one page; returns the exit code."""
    what = "Write one or several flights as a page that needs nothing else."
    options = read(ReportOptions, "pandion report", what, argv)
    from messages.ulog_reader import UlogError

    try:
        written = write_report(options.logs, options.html)
    except (UlogError, ValueError, OSError) as error:
        print_error("pandion report", error)
        return COULD_NOT_START
    say(f"{written}, {1e-6 * written.stat().st_size:.1f} MB")
    return WRITTEN


def write_report(logs: list[Path], out: Path | None = None) -> Path:
    """Write the page of flights, beside the first log unless told otherwise; the page.

    Raises:
        UlogError: A log cannot be read, or a result beside it cannot be used.
        ValueError: There are too many flights to tell apart.
        OSError: The page cannot be written.
        ModuleNotFoundError: The library that draws is not installed.
    """
    if len(logs) > _MOST:
        raise ValueError(f"{len(logs)} logs: a page holds at most {_MOST}")
    from view.report.page import page
    from view.report.reported import reported

    flights = [reported(path, label) for path, label in zip(logs, labels(logs), strict=True)]
    text = page(flights, {flight.label: _rows(flight) for flight in flights})
    first = flights[0].data.path
    written = out if out is not None else first.with_name(NAME)
    written.write_text(text, encoding="utf-8")
    return written


def labels(logs: list[Path]) -> list[str]:
    """A name for each flight: that of its directory, and of the ones above it where two agree."""
    folders = [(path if path.is_dir() else path.parent).resolve() for path in logs]
    depth = 1
    while True:
        named = ["/".join(folder.parts[-depth:]).strip("/") for folder in folders]
        if len(set(named)) == len(set(folders)) or depth > max(len(f.parts) for f in folders):
            break
        depth += 1
    counts: dict[str, int] = {}
    found = []
    for path, name in zip(logs, named, strict=True):
        label = name if path.is_dir() or path.name == "flight.ulg" else f"{name}/{path.stem}"
        counts[label] = counts.get(label, 0) + 1
        found.append(label if counts[label] == 1 else f"{label} ({counts[label]})")
    return found


def _rows(flight: Reported) -> list[tuple[str, str]]:
    """The table of the result; what an older build did not write is as after no flight."""
    if not flight.result:
        return []
    result: dict[str, Any] = as_json(FlightReports("", 0, "", None, None, None, {}))
    for key, value in flight.result.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = {**result[key], **value} if both else value
    return table_rows(result, flight.data.beside.get("sitl", {}).get("tracking_error_max_m"))
