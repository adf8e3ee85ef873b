"""The directory of a campaign: what is in which file, written and read.

campaign.toml   the campaign file, as it was given; scenarios by path lie beside it
journal.jsonl   one line a flight, appended and synchronised as it ends: the rows
campaign.json   what was flown with what: versions, digests, counts, worst flights
rows.parquet    the rows in the order of the flights, when all are there
campaign.html   the page
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from command_line.output import json_text
from command_line.version import version
from studies.campaign.flight import CampaignRow, code
from studies.campaign.identity import packages
from studies.campaign.journal import lines
from studies.campaign.keys import CampaignError
from studies.campaign.plan import CampaignPlan, load_plan

PLAN, JOURNAL, FACTS, TABLE, PAGE = (
    "campaign.toml",
    "journal.jsonl",
    "campaign.json",
    "rows.parquet",
    "campaign.html",
)


@dataclass(frozen=True, slots=True)
class Digests:
    """What must be equal for flights to be equal."""

    plan: str
    code: str  # of the stack, the simulator and what flies them
    packages: str


@dataclass(frozen=True, slots=True)
class CampaignResult:
    """A campaign as it lies in its directory."""

    plan: CampaignPlan
    rows: tuple[CampaignRow, ...]  # in the order of the flights; one a flight
    asked: int  # how many flights there are to be
    digests: Digests
    facts: dict[str, Any]  # campaign.json

    @property
    def complete(self) -> bool:
        """Whether every flight has a row."""
        return len(self.rows) == self.asked


def read(directory: Path) -> CampaignResult:
    """A campaign from its directory, whole or interrupted.

    Raises:
        CampaignError: It is none, or one of another version.
    """
    try:
        facts = json.loads((directory / FACTS).read_text(encoding="utf-8"))
        digests, asked = Digests(**facts["digests"]), int(facts["flights"])
    except (OSError, ValueError, TypeError, KeyError):
        raise CampaignError(
            f"{directory} is no directory of a campaign: {FACTS} is not there or of another "
            "version; give what `pandion campaign --out` was given"
        ) from None
    plan = replace(load_plan(directory / PLAN), name=str(facts.get("name", directory.name)))
    if plan.digest != digests.plan:
        if digests.code != code():
            raise CampaignError(
                f"{directory} was flown by other code ({digests.code[:8]}, here {code()[:8]}), "
                "which has other defaults: read it with Pandion "
                f"{facts.get('version', 'of that day')}"
            )
        raise CampaignError(f"{directory / PLAN} was changed after it was flown; fly it again")
    return CampaignResult(plan, _rows(directory / JOURNAL, asked), asked, digests, facts)


def begin(directory: Path, source: Path, plan: CampaignPlan, asked: int) -> None:
    """Make the directory of a campaign, or go on with one of the same flights.

    Raises:
        CampaignError: Something else lies there, or flights of other code.
        OSError: It cannot be written.
    """
    own = Digests(plan.digest, code(), packages())
    if (directory / FACTS).exists():
        _check_same(directory, read(directory), own)
    elif (directory / JOURNAL).exists():
        raise CampaignError(f"{directory} has a journal of something else; give another --out")
    directory.mkdir(parents=True, exist_ok=True)
    for name in plan.files:
        if (source.parent / name).resolve() != (directory / name).resolve():
            (directory / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source.parent / name, directory / name)
    if source.resolve() != (directory / PLAN).resolve():
        shutil.copyfile(source, directory / PLAN)
    write_facts(directory, plan, asked)


def write_facts(
    directory: Path, plan: CampaignPlan, asked: int, more: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Write what was flown with what, in one step; returns it."""
    facts = {
        "name": plan.name,
        "flights": asked,
        "digests": asdict(Digests(plan.digest, code(), packages())),
        "version": version(),
        "seed": plan.seed,
        "design": plan.design,
        "cases": [str(case) for case in plan.cases],
        "varied": [str(one) for one in plan.varied],
        **(more or {}),
    }
    unfinished = directory / f"{FACTS}.new"
    unfinished.write_text(json_text(facts, 1) + "\n", encoding="utf-8")
    unfinished.replace(directory / FACTS)
    return facts


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


def _rows(journal: Path, asked: int) -> tuple[CampaignRow, ...]:
    """One row a flight, the last that was written, in the order of the flights."""
    found: dict[int, CampaignRow] = {}
    for line in lines(journal):
        line.pop("key", None)
        try:
            row = CampaignRow(**line)
        except TypeError:
            continue  # cut short
        found[row.flight] = row
    return tuple(found[number] for number in sorted(found) if number < asked)


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
