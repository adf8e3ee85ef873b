"""``pandion faults``: let things fail in flight, and compare with what must happen."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from command_line.junit import Case, junit_xml
from command_line.options import group, json_file, option, read, switch
from command_line.output import console_beside, json_text, print_error, say, written
from command_line.parser import COULD_NOT_START, unknown_name
from command_line.values import output_file, whole
from command_line.version import version
from pandion.cluster_options import ClusterOptions, campaign_of
from pandion.display import Display
from pandion.gate_options import junit
from pandion.reproduce import seeds

if TYPE_CHECKING:
    from studies.fault_matrix.expectations import Expected
    from studies.fault_matrix.matrix import Cell, Judged

AS_EXPECTED, DIFFERS = 0, 1  # exit codes


def _one_or_more(text: str) -> range:
    """A seed, or ``A:B`` as a range."""
    if ":" in text:
        return seeds(text)
    first = whole()(text)
    return range(first, first + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultsOptions:
    """One cell, the matrix, or pairs of faults."""

    mode: str | None = option("MODE", "fly this mode alone")
    fault: str | None = option("FAULT", "with this fault; --matrix --list names them")
    matrix: bool = switch("--matrix", "every mode with every fault")
    pairs: int | None = option(
        "--pairs N", "N pairs of faults, drawn at random: what is hit is found", whole(1)
    )
    pair: int | None = option("--pair K", "pair K of them again, alone", whole())
    only: str | None = option(
        "--only TEXT", "of the matrix or the pairs: faults and modes with this text"
    )
    drawn: int | None = option(
        "--drawn N",
        "of the matrix, N cells drawn at random with --seed, each with a seed of its own",
        whole(1),
    )
    list: bool = switch("--list", "name what would be flown, MODE FAULT in each line")
    seed: range = option(
        "--seed N|A:B",
        "root of all randomness, or a flight with each from A to below B (default 0)",
        _one_or_more,
        default=range(1),
        text=lambda seeds: f"{seeds.start}:{seeds.stop}",
    )
    cluster: ClusterOptions = group(ClusterOptions)
    expect: Path | None = option("--expect FILE", "what must happen (default the packaged)", Path)
    journal: Path | None = option(
        "--journal FILE", "keep each flight here; one that is here is not flown again", Path
    )
    junit: str | None = junit()
    json: str | None = json_file("the cells")
    html: str | None = option("--html FILE", "write the matrix as a page", output_file)


class UnknownError(ValueError):
    """A mode or a fault that there is not."""


_NAMES: Final = "--matrix --list names all modes and faults"
_NEITHER: Final = f"give MODE and FAULT, --matrix, --pairs or --pair; {_NAMES}"
_DRAWN_SEEDS: Final = 1_000_000  # seeds of drawn cells are below this
_LIMIT_S: Final = 600.0  # of a pair's flight, which takes seconds: longer is a hang


def main(argv: list[str]) -> int:
    """Fly and compare; returns the exit code."""
    what = "Let something fail in flight and compare with what must happen."
    options = read(FaultsOptions, "pandion faults", what, argv)

    from studies.campaign.ports import SchedulerGoneError
    from studies.fault_matrix.expectations import EXPECTATIONS, ExpectationError, expectations

    try:
        known = expectations(options.expect or EXPECTATIONS)
        cells = _chosen(options, known)
        return _list(cells) if options.list else _run(options, cells)
    except (ExpectationError, UnknownError, SchedulerGoneError, OSError) as error:
        print_error("pandion faults", error)
        return COULD_NOT_START


def _chosen(options: FaultsOptions, known: dict[str, Expected]) -> list[Cell]:
    from studies.fault_matrix.flights import SITUATIONS

    many = options.matrix or options.pairs is not None
    asked = (options.matrix, options.pairs is not None, options.pair is not None, options.mode)
    if sum(map(bool, asked)) != 1:
        raise UnknownError(_NEITHER)
    if options.drawn is not None and not options.matrix:
        raise UnknownError("--drawn draws cells of the matrix: give --matrix with it")
    if options.only is not None and not many:
        raise UnknownError(
            "--only chooses cells of the matrix, or pairs: give --matrix or --pairs with it"
        )
    if options.pairs is not None or options.pair is not None:
        return _drawn(options)
    if options.matrix:
        return _of_matrix(options, known)
    if options.mode not in SITUATIONS:
        raise UnknownError(_unknown("mode", options.mode, tuple(SITUATIONS)))
    if options.fault not in known:
        raise UnknownError(_unknown("fault", options.fault, tuple(known)))
    expected = known[options.fault]
    if options.mode not in expected.modes:
        raise UnknownError(f"{options.mode} is not flown with {expected.suite}: see not_flown")
    return [_cell(options.mode, expected, seed) for seed in options.seed]


def _of_matrix(options: FaultsOptions, known: dict[str, Expected]) -> list[Cell]:
    """All cells, or those that are drawn, which have seeds that nobody has looked at."""
    from sitl.seeds import stream

    every = [
        (mode, one)
        for one in known.values()
        for mode in one.modes
        if options.only is None or options.only in f"{mode} {one.name}"
    ]
    if not every:
        raise UnknownError(f"no fault and no mode contains {options.only!r}")
    if options.drawn is None:
        return [_cell(mode, one, seed) for mode, one in every for seed in options.seed]
    random = stream(_only_seed(options, "cells"), "cells")
    chosen = random.integers((len(every), _DRAWN_SEEDS), size=(options.drawn, 2)).tolist()
    picked = [(*every[number], seed) for number, seed in chosen]
    return [_cell(mode, one, seed) for mode, one, seed in picked]


def _only_seed(options: FaultsOptions, what: str) -> int:
    if len(options.seed) != 1:
        raise UnknownError(f"{what} are drawn from one seed: give --seed N")
    return options.seed.start


def _drawn(options: FaultsOptions) -> list[Cell]:
    from studies.fault_matrix.expectations import EXPECTATIONS, not_flown
    from studies.fault_matrix.pairs import draw

    seed = _only_seed(options, "pairs")
    numbers = range(options.pairs or 0) if options.pair is None else (options.pair,)
    without, only = not_flown(options.expect or EXPECTATIONS), options.only or ""
    drawn = [draw(seed, number, without) for number in numbers]
    found: list[Cell] = [one for one in drawn if only in f"{one.mode} {one.expected.name}"]
    if not found:
        raise UnknownError(f"none of {len(drawn)} pairs contains {only!r}")
    return found


def _cell(mode: str, expected: Expected, seed: int) -> Cell:
    from pandion.fault_on_link import LinkCell
    from studies.fault_matrix.matrix import Cell

    return LinkCell(mode, expected, seed) if expected.link else Cell(mode, expected, seed)


def _unknown(what: str, name: str | None, known: tuple[str, ...]) -> str:
    return _NEITHER if name is None else f"{unknown_name(what, name, known)}; {_NAMES}"


def _list(cells: list[Cell]) -> int:
    for line in dict.fromkeys(f"{cell.mode:10} {cell.expected.name}" for cell in cells):
        say(line)
    return AS_EXPECTED


def _run(options: FaultsOptions, cells: list[Cell]) -> int:
    from studies.fault_matrix.page import page, summary

    display = Display(console_beside(options.json))
    seed = "–".join(map(str, sorted({options.seed.start, options.seed.stop - 1})))
    display.say(f"Pandion {version()}: {len(cells)} flights, seed {seed}")
    try:
        with display.progress():
            rows = _flown(cells, options, display)
    except KeyboardInterrupt:
        kept = "is lost" if options.journal is None else f"is in {options.journal}"
        print_error("pandion faults", f"interrupted; what was flown {kept}")
        return COULD_NOT_START
    for row in rows:
        if row.differs or len(rows) == 1:
            _say(display, row, summary(row))
            if len(rows) > 1:
                display.say(f"{'':11}again: pandion faults {_again(options, row.cell)}")
    if len(rows) == 1:
        for said in rows[0].flight.texts:
            display.say(f"  {said.after_s:8.3f} s  {said.text}")
    wrong = sum(1 for row in rows if row.differs)
    for name, count in Counter(one for row in rows for one in row.known).items():
        display.say(f"known limit {name}: {count}")
    display.say(f"{len(rows) - wrong} of {len(rows)} as they must be")
    texts: list[tuple[str | None, str]] = [
        (options.json, json_text([row.as_json() for row in rows], 1) + "\n"),
        (options.junit, junit_xml("faults", [_case(row) for row in rows])),
    ]
    if options.html is not None:
        texts.append((options.html, page(rows, (f"Pandion {version()}, seed {seed}",))))
    all_written = written("pandion faults", *texts)
    return AS_EXPECTED if all_written and not wrong else DIFFERS


def _again(options: FaultsOptions, cell: Cell) -> str:
    """What flies a cell of many alone."""
    name = cell.expected.name
    if options.pairs is None:
        return f"{cell.mode} {name} --seed {cell.seed}"
    return f"--{name.partition(':')[0]} --seed {options.seed.start}"


def _case(row: Judged) -> Case:
    name = f"{row.cell.expected.name}, seed {row.cell.seed}"
    broke = row.flight.problem if row.flight.error else ""
    failure = "" if broke else "; ".join(row.differs)
    return Case(row.cell.mode, name, row.flight.took_s, failure=failure, error=broke)


def _flown(cells: list[Cell], options: FaultsOptions, display: Display) -> list[Judged]:
    """Flights in process on all workers, then those in real time, one after the other."""
    from studies.fault_matrix.matrix import judge
    from studies.fault_matrix.pairs import judge_pair, known_limits

    inside = [cell for cell in cells if not cell.expected.link]
    linked = [cell for cell in cells if cell.expected.link]
    here = ClusterOptions(workers=0)

    def report(before: int, done: int, _: int) -> None:
        display.report("flown", before + done, len(cells))

    where = here if len(inside) == 1 else options.cluster
    more = {"time_limit_s": _LIMIT_S} if options.pairs is not None else {}
    of_processes = campaign_of(
        where, options.journal, report=partial(report, 0), say=display.say, **more
    )
    one_by_one = campaign_of(here, options.journal, report=partial(report, len(inside)))
    found = of_processes.run(inside) + one_by_one.run(linked)
    flights = dict(zip((*inside, *linked), found, strict=True))
    if options.pairs is None and options.pair is None:
        return [judge(cell, flights[cell]) for cell in cells]
    limits = known_limits()
    return [judge_pair(cell, flights[cell], limits) for cell in cells]


def _say(display: Display, row: Judged, summary: str) -> None:
    known = f"known limit: {', '.join(row.known)}" if row.known else ""
    verdict = "; ".join(row.differs) or known or row.flight.ended or "as it must be"
    display.say(f"{row.cell.mode:10} {row.cell.expected.name:24} {summary}: {verdict}")
