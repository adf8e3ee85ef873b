"""``pandion reproduce``: fly a table or a figure of the paper again and write it down."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from fsw.log.run_directory import new_run_directory
from pandion.output import console_beside, write_text
from pandion.parser import COULD_NOT_START, Parser, unknown_name
from pandion.progress import Progress
from pandion.version import version

if TYPE_CHECKING:
    from studies.settings import Report, Settings

# As in studies.catalogue, which takes a second to import; a test compares the two.
WHAT = ("table3", "table4", "fig2", "fig6", "fig7", "fig8", "robustness", "smallest-sphere")
PLANTS = ("double-integrator", "full")
INNERS = ("tracking", "pid")

DONE, BROKEN = 0, 1  # exit codes


@dataclass(frozen=True, slots=True)
class ReproduceOptions:
    """One study."""

    what: str
    plant: str
    seeds: range
    duration_s: float | None
    inner: str
    workers: int
    json: str | None
    out: Path | None


def main(argv: list[str]) -> int:
    """Run one study; returns the exit code."""
    options = _options(argv)
    from studies.one_thread import pin_threads

    pin_threads()  # before NumPy loads
    from studies.drawing import NoMatplotlibError

    try:
        return _run(options)
    except (NoMatplotlibError, OSError) as error:
        print(f"pandion reproduce: {error}", file=sys.stderr)
        return COULD_NOT_START


def _options(argv: list[str]) -> ReproduceOptions:
    parser = Parser("pandion reproduce", "Fly a table or a figure of the paper again.")
    parser.add_argument("what", metavar="WHAT", type=_known("study", WHAT), help=", ".join(WHAT))
    parser.add_argument(
        "--plant",
        metavar="NAME",
        type=_known("plant", PLANTS),
        default="full",
        help="full, or double-integrator: the paper's prediction model as the plant "
        "(default %(default)s)",
    )
    parser.add_argument(
        "--seeds",
        metavar="A:B",
        type=seeds,
        default=range(100, 120),
        help="from A up to but not including B; 0:30 were used for tuning (default 100:120)",
    )
    parser.add_argument(
        "--duration", metavar="S", type=_positive, help="of each flight (default the paper's 120)"
    )
    parser.add_argument(
        "--inner",
        metavar="NAME",
        type=_known("inner loop", INNERS),
        default="tracking",
        help="fast loop of the full plant, tracking or pid (default %(default)s)",
    )
    parser.add_argument(
        "--workers",
        metavar="N",
        type=_workers,
        default=os.cpu_count() or 1,
        help="processes; 0 flies in this one (default one a core: %(default)s)",
    )
    parser.add_argument(
        "--json", metavar="FILE", help="write the rows as a list; - for standard output"
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        type=Path,
        help="where page, figures and journal go; a directory with a journal is resumed "
        "(default a new one in runs/)",
    )
    read = parser.read(argv)
    return ReproduceOptions(
        read.what,
        read.plant,
        read.seeds,
        read.duration,
        read.inner,
        read.workers,
        read.json,
        read.out,
    )


def seeds(text: str) -> range:
    """``A:B`` as a range, like Python's.

    Raises:
        argparse.ArgumentTypeError: Not that, or empty.
    """
    first, colon, last = text.partition(":")
    if not (colon and first.isdecimal() and last.isdecimal() and int(first) < int(last)):
        raise argparse.ArgumentTypeError(f"{text!r} is not A:B with A < B, such as 100:120")
    return range(int(first), int(last))


def _known(what: str, names: tuple[str, ...]) -> Any:
    def check(text: str) -> str:
        if text not in names:
            raise argparse.ArgumentTypeError(unknown_name(what, text, names))
        return text

    return check


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.1 <= value <= 86400.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a duration in seconds")
    return value


def _workers(text: str) -> int:
    if not text.isdecimal() or int(text) > 1024:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of processes")
    return int(text)


def _run(options: ReproduceOptions) -> int:
    from studies.campaign import Campaign
    from studies.catalogue import STUDIES
    from studies.output import json_text, write

    console = console_beside(options.json)
    settings = _settings(options)
    folder = options.out or new_run_directory(Path("runs"), options.what)
    print(f"Pandion {version()}: {options.what}, written to {folder}", file=console, flush=True)
    if settings.tuned_on:
        print("these seeds were used for tuning; report others", file=console, flush=True)
    try:
        with Progress(console, lines=10) as progress:
            campaign = Campaign(
                options.workers, folder / "journal.jsonl", partial(progress.report, "flown")
            )
            report = STUDIES[options.what](settings, campaign)
    except KeyboardInterrupt:
        print(f"pandion reproduce: interrupted; --out {folder} resumes", file=sys.stderr)
        return BROKEN
    page = write(report, settings, _provenance(options), options.what, folder)
    _show(report, console)
    print(f"page {page}", file=console)
    write_text(options.json, json_text(report))
    for error in report.errors:
        print(f"pandion reproduce: {error}", file=sys.stderr)
    return BROKEN if report.errors else DONE


def _settings(options: ReproduceOptions) -> Settings:
    from studies.settings import Settings

    return Settings(
        plant="full" if options.plant == "full" else "double-integrator",
        seeds=options.seeds,
        duration_s=options.duration_s,
        inner="pid" if options.inner == "pid" else "tracking",
    )


def _provenance(options: ReproduceOptions) -> tuple[str, ...]:
    from studies.job import sources

    command = f"pandion reproduce {options.what} --plant {options.plant}"
    command += f" --seeds {options.seeds.start}:{options.seeds.stop}"
    if options.duration_s is not None:
        command += f" --duration {options.duration_s:g}"
    if options.inner != "tracking":
        command += f" --inner {options.inner}"
    return (f"Command: {command}", f"Pandion {version()}, code {sources()[:12]}")


def _show(report: Report, stream: TextIO) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(file=stream, highlight=False, width=None if stream.isatty() else 160)
    for table in report.tables:
        drawn = Table(title=table.caption, title_justify="left")
        for k, name in enumerate(table.headers):
            drawn.add_column(name, justify="left" if k < 2 else "right")
        for row in table.rows:
            drawn.add_row(*row)
        console.print(drawn)
