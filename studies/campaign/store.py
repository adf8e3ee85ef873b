"""The directory of a campaign: what is in which file, written and read.

campaign.toml   the campaign file, as it was given; scenarios by path lie beside it
journal.jsonl   one line a flight, appended and synchronised as it ends: the rows
campaign.json   what was flown with what: versions, digests, counts, worst flights
rows.parquet    the rows in the order of the flights, when all are there
campaign.html   the page
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from command_line.bounded_file import read_bounded
from command_line.bounded_json import read_json
from command_line.output import json_text
from command_line.version import version
from studies.campaign.flight import CampaignRow, code, row_key, row_of
from studies.campaign.identity import packages
from studies.campaign.journal import Journal, JournalError, Seal, lines, sealed_lines
from studies.campaign.keys import CampaignError
from studies.campaign.plan import CampaignPlan, load_plan
from studies.campaign.values import MAX_FLIGHTS
from studies.flight.kept_row import kept_row

PLAN, JOURNAL, FACTS, TABLE, PAGE = (
    "campaign.toml",
    "journal.jsonl",
    "campaign.json",
    "rows.parquet",
    "campaign.html",
)
_MAX_BYTES: Final = 16 * 1024 * 1024  # of the facts


@dataclass(frozen=True, slots=True)
class Digests:
    """What must be equal for flights to be equal."""

    plan: str
    code: str  # of the stack, the simulator and what flies them
    packages: str


@dataclass(frozen=True, slots=True)
class KeptRows:
    """The rows of a campaign, whatever code has flown them."""

    rows: tuple[CampaignRow, ...]  # in the order of the flights; one a flight
    digests: Digests
    facts: dict[str, Any]  # campaign.json
    file: str  # campaign.toml


@dataclass(frozen=True, slots=True)
class CampaignResult:
    """A campaign as it lies in its directory."""

    plan: CampaignPlan
    rows: tuple[CampaignRow, ...]  # in the order of the flights; one a flight
    asked: int  # how many flights there are to be
    digests: Digests
    facts: dict[str, Any]  # campaign.json
    left_out: int  # lines of the journal that are no rows of these flights
    seal: Seal  # of the journal
    sealed: Seal  # that campaign.json was written with

    @property
    def complete(self) -> bool:
        """Whether every flight has a row."""
        return len(self.rows) == self.asked

    @property
    def by_case(self) -> dict[str, tuple[CampaignRow, ...]]:
        """The rows of each configuration that has some."""
        count = len(self.plan.cases)
        found = {
            str(case): tuple(row for row in self.rows if row.flight % count == k)
            for k, case in enumerate(self.plan.cases)
        }
        return {name: rows for name, rows in found.items() if rows}


def read(directory: Path) -> CampaignResult:
    """A campaign from its directory, whole or interrupted.

    A line of the journal is a row of it if its key is that of the flight, for the plan and the
    state of the code that flew it, which may be another than this one. No row is left out because
    fewer flights were asked for.

    Raises:
        CampaignError: It is none, or one of another version.
        JournalError: The journal does not verify, or has lost lines.
    """
    facts, digests, asked, sealed = _known_facts(directory)
    plan = replace(load_plan(directory / PLAN), name=str(facts.get("name", directory.name)))
    if plan.digest != digests.plan:
        if digests.code != code():
            raise CampaignError(
                f"{directory} was flown by other code ({digests.code[:8]}, here {code()[:8]}), "
                "which has other defaults: read it with Pandion "
                f"{facts.get('version', 'of that day')}"
            )
        raise CampaignError(f"{directory / PLAN} was changed after it was flown; fly it again")
    rows, left_out, seal = _rows(directory / JOURNAL, partial(row_of, plan), digests, sealed)
    asked = max([asked, *(row.flight + 1 for row in rows[-1:])])
    return CampaignResult(plan, rows, asked, digests, facts, left_out, seal, sealed)


def read_rows(directory: Path) -> KeptRows:
    """The rows of a campaign that other code may have flown, whose plan cannot be drawn again here.

    Raises:
        CampaignError: It is none, one of another version, or one without a row.
        JournalError: The journal does not verify, or has lost lines.
    """
    facts, digests, _, sealed = _known_facts(directory)
    rows, _, _ = _rows(directory / JOURNAL, partial(kept_row, CampaignRow), digests, sealed)
    if not rows:
        raise CampaignError(f"{directory} has no row that this version of Pandion can read")
    try:
        file = read_bounded(directory / PLAN, _MAX_BYTES).decode("utf-8", "replace")
    except OSError as error:
        raise CampaignError(f"{directory / PLAN} cannot be read: {error.strerror}") from None
    return KeptRows(rows, digests, facts, file)


def _known_facts(directory: Path) -> tuple[dict[str, Any], Digests, int, Seal]:
    kept = _facts(directory)
    if kept is None:
        raise CampaignError(
            f"{directory} is no directory of a campaign: {FACTS} is not there, is damaged, was "
            "changed or is of another version; give what `pandion campaign --out` was given, or "
            "mend it with that command"
        )
    return kept


def _facts(directory: Path) -> tuple[dict[str, Any], Digests, int, Seal] | None:
    """What campaign.json says, its digests, flights and seal; None if it cannot be read or used."""
    try:
        facts = read_json(directory / FACTS, _MAX_BYTES)
        digests, asked = Digests(**facts["digests"]), facts["flights"]
        whole = sealed_facts(facts) == facts
        sealed = kept_row(Seal, facts.pop("journal"))
    except (OSError, ValueError, TypeError, KeyError):
        return None
    known = whole and all(isinstance(one, str) for one in asdict(digests).values())
    if isinstance(asked, bool) or not isinstance(asked, int) or not 1 <= asked <= MAX_FLIGHTS:
        return None
    return (facts, digests, asked, sealed) if known else None


def begin(directory: Path, source: Path, plan: CampaignPlan, flights: int | None = None) -> int:
    """Make the directory of a campaign, or go on with one of the same flights.

    Returns how many ``flights`` there are to be: without a number those of the file, or as many as
    the directory has if it has more. They are never fewer than before, because a certificate of
    the first of them could stop before one that went wrong.

    Raises:
        CampaignError: Something else lies there, flights of other code, or more than are asked for.
        JournalInUseError: They are being flown.
        OSError: It cannot be written.
    """
    asked = flights or plan.count
    if (directory / JOURNAL).exists():
        Journal(directory / JOURNAL).close()  # which mends what a crash has left of a line
    there = _there(directory, plan)
    if flights is not None and flights < there:
        raise CampaignError(
            f"{directory} has a campaign of {there} flights, and none may be left out: leave out "
            f"--flights, or give at least {there} or another --out"
        )
    asked = max(asked, there)
    directory.mkdir(parents=True, exist_ok=True)
    with closing(Journal(directory / JOURNAL)) as journal:
        for name in plan.files:
            if (source.parent / name).resolve() != (directory / name).resolve():
                (directory / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source.parent / name, directory / name)
        if source.resolve() != (directory / PLAN).resolve():
            text = source.read_text(encoding="utf-8")
            (directory / PLAN).write_text(plan.head + text, encoding="utf-8")
        write_facts(directory, plan, asked, journal.seal)
    return asked


def check_flown_here(directory: Path, result: CampaignResult) -> None:
    """Refuse a campaign whose flights would be others if they were flown here and now.

    Raises:
        CampaignError: It was flown by other code or with other packages.
    """
    for what, found, wanted in (
        ("code", result.digests.code, code()),
        ("packages", result.digests.packages, packages()),
    ):
        if found != wanted:
            raise CampaignError(
                f"{directory} was flown by other {what} ({found[:8]}, here {wanted[:8]}), with "
                "which a flight may go otherwise: fly it again with Pandion "
                f"{result.facts.get('version', 'of that day')} and its locked packages"
            )


def left_out(lines: int) -> str:
    """The sentence about ``lines`` of a journal that are no rows of its campaign."""
    return (
        f"{lines} lines of {JOURNAL} are not counted: they are damaged, or rows of another plan or "
        "another command"
    )


def refuse_campaign(directory: Path) -> None:
    """Refuse a directory that a campaign has, before another command writes to its journal.

    Raises:
        CampaignError: A campaign lies there.
    """
    if (directory / FACTS).exists():
        raise CampaignError(f"{directory} is the directory of a campaign; give another --out")


def _there(directory: Path, plan: CampaignPlan) -> int:
    """How many flights of a plan a directory is to have already; 0: none is begun there.

    Raises:
        CampaignError: Something else lies there.
    """
    if not (directory / FACTS).exists() and not (directory / JOURNAL).exists():
        return 0
    own = Digests(plan.digest, code(), packages())
    if _facts(directory) is not None:
        found = read(directory)
        _check_same(directory, found, own)
        return found.asked
    # A crash or a full disk left no facts. They follow from the file and the rows, if both are
    # those of this plan and this code.
    rows, _, _ = _rows(directory / JOURNAL, partial(row_of, plan), own, Seal())
    if not rows and any(lines(directory / JOURNAL)):
        raise CampaignError(f"{directory} has a journal of something else; give another --out")
    if rows and (not (directory / PLAN).exists() or load_plan(directory / PLAN).digest != own.plan):
        raise CampaignError(
            f"{directory} has rows, but not the campaign file that they were flown from; give "
            "another --out"
        )
    return rows[-1].flight + 1 if rows else 0


def write_facts(
    directory: Path,
    plan: CampaignPlan,
    asked: int,
    seal: Seal,
    more: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Write what was flown with what, in one step that outlives a crash; returns it.

    ``seal`` is that of the journal: what it has now, it must have for ever.
    """
    facts = sealed_facts(
        {
            "name": plan.name,
            "flights": asked,
            "digests": asdict(Digests(plan.digest, code(), packages())),
            "journal": asdict(seal),
            "version": version(),
            "seed": plan.seed,
            "design": plan.design,
            "cases": [str(case) for case in plan.cases],
            "varied": [str(one) for one in plan.varied],
            **(more or {}),
        }
    )
    unfinished = directory / f"{FACTS}.new"
    with unfinished.open("w", encoding="utf-8") as file:
        file.write(json_text(facts, 1) + "\n")
        file.flush()
        os.fsync(file.fileno())  # or the name could be on the disk before what it names
    unfinished.replace(directory / FACTS)
    folder = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
    return facts


def sealed_facts(facts: dict[str, Any]) -> dict[str, Any]:
    """The facts with the digest of all of them, the seal of the journal too, as their ``seal``."""
    own = {name: part for name, part in facts.items() if name != "seal"}
    return own | {"seal": hashlib.sha256(json_text(own).encode()).hexdigest()}


def _check_same(directory: Path, there: CampaignResult, own: Digests) -> None:
    for what, found, wanted in (
        ("another campaign", there.digests.plan, own.plan),
        ("other code", there.digests.code, own.code),
        ("other packages", there.digests.packages, own.packages),
    ):
        if found != wanted:
            raise CampaignError(
                f"{directory} has flights of {what} ({found[:8]}, here {wanted[:8]}); their rows "
                "would not belong together: give another --out"
            )


def _rows(
    journal: Path,
    row_in: Callable[[dict[str, Any]], CampaignRow],
    digests: Digests,
    sealed: Seal,
) -> tuple[tuple[CampaignRow, ...], int, Seal]:
    """One row a flight, the last that was written, in their order; how many lines are none.

    Raises:
        JournalError: The journal does not verify, does not begin as it was ``sealed``, or has
            another row of a flight that did not break.
    """
    found: dict[int, CampaignRow] = {}
    left_out, seal, kept = 0, Seal(), sealed == Seal()
    for line, seal in sealed_lines(journal):
        kept = kept or seal == sealed
        key = line.pop("key", None)
        try:
            row = row_in(line)
        except TypeError:
            left_out += 1
            continue
        if key != row_key(digests.plan, row.flight, digests.code):
            left_out += 1
            continue
        if row.flight in found and not found[row.flight].error:
            raise JournalError(
                f"{journal}, line {seal.lines} is a second row of flight {row.flight}, which "
                "did not break and is to have one: fly the campaign again into another --out"
            )
        found[row.flight] = row
    if not kept:
        raise JournalError(
            f"{journal} has {seal.lines} lines, which are not the {sealed.lines} that {FACTS} was "
            "written with: lines were taken away, or it is another journal; fly it again"
        )
    return tuple(found[number] for number in sorted(found)), left_out, seal


def write_table(directory: Path, rows: Iterable[CampaignRow]) -> Path | None:
    """Write the rows as Parquet, a column a field; None if pyarrow is not installed.

    Fields of the machine are left out: equal campaigns have equal files.
    """
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        return None
    flat = []
    for row in rows:
        line = row.compared()
        values = line.pop("values")
        flat.append(line | {f"vary.{key}": value for key, value in values.items()})
    written = directory / TABLE
    parquet.write_table(pa.Table.from_pylist(flat), written)
    return written
