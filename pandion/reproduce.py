"""``pandion reproduce``: fly a table or a figure of the paper again and write it down."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Final, TextIO

from command_line.junit import Case, junit_xml
from command_line.options import group, json_file, option, read
from command_line.output import console_beside, print_error, say, write_text
from command_line.parser import COULD_NOT_START
from command_line.run_directory import new_run_directory
from command_line.toml_tables import shown
from command_line.values import LARGEST_SEED, number, one_of, whole
from command_line.version import version
from fsw.autopilot.parameters.control_choice import KNOWN
from pandion.cluster_options import ClusterOptions, campaign_of
from pandion.display import Display
from pandion.gate_options import junit
from pandion.own_options import OwnOptions
from sitl.scenario_file import SUITE_NAMES
from studies.paper.catalogue import STUDIES, study

if TYPE_CHECKING:
    from studies.paper.settings import Report, Settings

PLANTS = ("double-integrator", "full")
FAMILIES = ("walls", "dash")
TRACKING = KNOWN["tracking"]

DONE, BROKEN = 0, 1  # exit codes
WIDTH: Final = 100  # of a table on the terminal, in characters
KEYS: Final = 2  # columns that name a row
# The first result of a row, after what names it: the name of a test is the same each night.
_RESULTS: Final = ("passed", "completed", "x_m", "tc_s", "on_front")


def seeds(text: str) -> range:
    """``A:B`` as a range, like Python's.

    Raises:
        argparse.ArgumentTypeError: Not that, or empty.
    """
    first, _, last = text.partition(":")
    try:
        found = range(whole()(first), whole()(last))
    except argparse.ArgumentTypeError:
        found = range(0)
    if not found:
        raise argparse.ArgumentTypeError(
            f"{shown(text)} is not A:B with A < B, such as 100:120, both at most {LARGEST_SEED}"
        )
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class ReproduceOptions:
    """One study."""

    what: str = option("WHAT", ", ".join(STUDIES), one_of("study", *STUDIES), required=True)
    plant: str = option(
        "--plant NAME",
        "full, or double-integrator: the paper's prediction model as the plant",
        one_of("plant", *PLANTS),
        default="full",
    )
    seeds: range = option(
        "--seeds A:B",
        "from A up to but not including B; 0:30 were used for tuning",
        seeds,
        default=range(100, 120),
        text=lambda seeds: f"{seeds.start}:{seeds.stop}",
    )
    duration_s: float | None = option(
        "--duration S",
        "of each flight, in seconds (default the paper's 120)",
        number(0.1, 86400.0, "s"),
    )
    tracking: str = option(
        "--tracking NAME",
        "inner loop of the full plant, lqr or pid",
        one_of("tracking", *TRACKING, old={"tracking": "lqr"}),
        default="lqr",
        old="--inner",
    )
    scenario: str = option(
        "--scenario NAME",
        "table4, rivals: walls, or dash, whose paths are too fast for the horizon",
        one_of("scenario", *FAMILIES),
        default="walls",
    )
    suite: str | None = option(
        "--sensors SUITE",
        "robustness: only the rows flown with these sensors",
        one_of("suite", *SUITE_NAMES),
        old="--suite",
    )
    only: str | None = option(
        "--only TEXT", "robustness: only the rows with this in their section, case or name"
    )
    cluster: ClusterOptions = group(ClusterOptions)
    own: OwnOptions = group(OwnOptions)
    junit: str | None = junit()
    json: str | None = json_file("the rows")
    out: Path | None = option(
        "--out DIR",
        "where page, figures and journal go; a directory with a journal is resumed "
        "(default a new one in runs/)",
        Path,
    )


def main(argv: list[str]) -> int:
    """Run one study; returns the exit code."""
    what = "Reproduce a table or a figure of the paper."
    options = read(ReproduceOptions, "pandion reproduce", what, argv)

    from studies.campaign.keys import CampaignError
    from studies.campaign.ports import SchedulerGoneError
    from studies.drawing import NoMatplotlibError
    from studies.flight.own_parts import OwnPartError
    from studies.paper.settings import NoCellError

    try:
        if options.what != "robustness" and (options.suite or options.only):
            raise NoCellError(f"{options.what} has no rows to choose by --sensors or --only")
        if options.scenario != "walls" and options.what not in ("table4", "rivals"):
            raise NoCellError(f"{options.what} is of one pair of scenarios, without --scenario")
        own = options.own
        if (own.planner or own.controller) and options.what != "table4":
            raise NoCellError(f"{options.what} flies no --planner or --controller; table4 does")
        if own.controller and options.plant != "full":
            raise NoCellError("--controller flies rotors and joints: it needs --plant full")
        return _run(options)
    except (
        OwnPartError,
        NoMatplotlibError,
        NoCellError,
        CampaignError,
        SchedulerGoneError,
        OSError,
    ) as error:
        print_error("pandion reproduce", error)
        return COULD_NOT_START


def _run(options: ReproduceOptions) -> int:
    from studies.campaign.store import refuse_campaign
    from studies.paper.page import rows_text, write

    console = console_beside(options.json)
    settings = _settings(options)
    folder = options.out or new_run_directory(Path("runs"), options.what)
    refuse_campaign(folder)
    say(f"Pandion {version()}: {options.what}, written to {folder}", console)
    if settings.tuned_on:
        print("these seeds were used for tuning; report others", file=console, flush=True)
    try:
        display = Display(console)
        with display.progress():
            report = partial(display.report, "flown")
            journal = folder / "journal.jsonl"
            with campaign_of(options.cluster, journal, report=report, say=display.say) as campaign:
                found = study(options.what)(settings, campaign)
    except KeyboardInterrupt:
        print_error("pandion reproduce", f"interrupted; --out {folder} resumes")
        return BROKEN
    page = write(found, settings, _provenance(options), options.what, folder)
    _show(found, console)
    say(f"page {page}", console)
    write_text(options.json, rows_text(found))
    write_text(options.junit, junit_xml(options.what, _cases(found)))
    for error in found.errors:
        print_error("pandion reproduce", error)
    return BROKEN if found.errors else DONE


def _settings(options: ReproduceOptions) -> Settings:
    from studies.flight.job import INNER
    from studies.paper.settings import Settings

    return Settings(
        plant="full" if options.plant == "full" else "double-integrator",
        seeds=options.seeds,
        duration_s=options.duration_s,
        inner=INNER[options.tracking],
        family="dash" if options.scenario == "dash" else "walls",
        suite=options.suite,
        only=options.only,
        own_planner=options.own.planner,
        own_controller=options.own.controller,
    )


def _provenance(options: ReproduceOptions) -> tuple[str, ...]:
    from studies.flight.job import sources

    command = f"pandion reproduce {options.what} --plant {options.plant}"
    command += f" --seeds {options.seeds.start}:{options.seeds.stop}"
    if options.duration_s is not None:
        command += f" --duration {options.duration_s:g}"
    if options.scenario != "walls":
        command += f" --scenario {options.scenario}"
    if options.suite is not None:
        command += f" --sensors {options.suite}"
    if options.only is not None:
        command += f" --only '{options.only}'"
    if options.tracking != "lqr":
        command += f" --tracking {options.tracking}"
    for name in ("planner", "controller"):
        part = getattr(options.own, name)
        command += f" --{name} {part}" if part else ""
    return (f"Command: {command}", f"Pandion {version()}, code {sources()[:12]}")


def _cases(report: Report) -> list[Case]:
    """A test a row, failed where the paper prints another mark; and one a flight that broke."""
    cases = []
    for row in report.rows:
        named = takewhile(lambda key: key not in _RESULTS, row)
        name = ", ".join(f"{key} {row[key]}" for key in named)
        printed, flown = row.get("paper_completed"), row.get("passed") == row.get("total")
        failure = ""
        if printed is not None and printed != flown:
            mark = "completed" if printed else "not completed"
            failure = f"the paper prints {mark}; {row['passed']} of {row['total']} are completed"
        cases.append(Case(report.title, name, row["took_s"], failure))
    return cases + [Case(report.title, f"error {k}", error=e) for k, e in enumerate(report.errors)]


def _show(report: Report, stream: TextIO) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    terminal = Console(file=stream).width if stream.isatty() else WIDTH
    console = Console(file=stream, highlight=False, width=min(terminal, WIDTH))
    for table in report.tables:
        console.print(table.caption, markup=False)  # as a title it is as narrow as the table
        for block in blocks([table.headers, *table.rows], console.width):
            drawn = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
            headers, *rows = block
            widths = _widths(block, console.width)
            for k, (name, width) in enumerate(zip(headers, widths, strict=True)):
                drawn.add_column(name, justify="left" if k < KEYS else "right", width=width)
            for row in rows:
                drawn.add_row(*row)
            console.print(drawn)


def _widths(lines: list[tuple[str, ...]], width: int) -> list[int]:
    """Of columns: their longest words, and what is left to those whose cells would break."""
    columns = list(zip(*lines, strict=True))
    found = [_narrowest(column) for column in columns]
    wanted = [max(map(len, column)) for column in columns]
    for _ in range(width - sum(found) - len(found)):
        k = max(range(len(found)), key=lambda k: wanted[k] - found[k])
        found[k] += found[k] < wanted[k]
    return found


def _narrowest(column: Sequence[str]) -> int:
    return max(len(word) for cell in column for word in cell.split() or [""])


def blocks(lines: list[tuple[str, ...]], width: int) -> list[list[tuple[str, ...]]]:
    """A table as blocks of columns that fit a width, each with the columns that name a row.

    Args:
        lines: The headers, then the rows.
        width: Of the terminal, in characters. A column may be as narrow as its longest word.
    """
    need = [_narrowest(column) + 1 for column in zip(*lines, strict=True)]
    names = list(range(min(KEYS, len(need))))
    chosen: list[list[int]] = []
    for k in range(len(names), len(need)):
        if not chosen or sum(need[j] for j in (*chosen[-1], k)) > width:
            chosen.append([*names])
        chosen[-1].append(k)
    return [[tuple(line[k] for k in of) for line in lines] for of in chosen or [names]]
