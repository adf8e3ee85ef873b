"""The requirements of the safety manual, and the tests that say which of them they show."""

from __future__ import annotations

import ast
import functools
import re
import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from fsw.autopilot.flight.commands.arming import CHECKS
from fsw.autopilot.flight.failsafe.conditions import Condition

ROOT: Final = Path(__file__).parents[2]
FILE: Final = ROOT / "docs" / "reference" / "requirements.toml"
MARKER: Final = "pytest.mark.requirement"
CONDITIONS: Final = tuple(Condition.__members__)
ARMING_CHECKS: Final = tuple(check.summary for check in CHECKS)
_ID: Final = re.compile(r"REQ-([A-Z]+)-[1-9]\d*")


@dataclass(frozen=True, slots=True)
class Requirement:
    """One sentence with "shall", and what implements it."""

    id: str
    shall: str
    conditions: tuple[str, ...] = ()  # names of Condition
    checks: tuple[str, ...] = ()  # summaries of arming checks
    by: tuple[str, ...] = ()  # files, where that is no row of a table
    action: str = ""  # of those


@dataclass(frozen=True, slots=True)
class Manual:
    """Everything in the file of requirements."""

    groups: Mapping[str, str]  # a heading each
    requirements: tuple[Requirement, ...]
    not_shown: Mapping[str, str]  # why no test shows it


@dataclass(frozen=True, slots=True)
class ShowingTest:
    """A test that is marked with a requirement."""

    file: str  # from the root of the checkout
    name: str
    is_long: bool  # left out by `make test`


Shown = Mapping[str, tuple[ShowingTest, ...]]


def load(text: str | None = None) -> Manual:
    """The manual in a text, or in its file.

    Raises:
        ValueError: A table has a key that is not known, or lacks one.
    """
    found = tomllib.loads(FILE.read_text(encoding="utf-8") if text is None else text)
    rows = []
    for table in found["requirements"]:
        values: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in table.items()
        }
        try:
            rows.append(Requirement(**values))
        except TypeError as error:
            raise ValueError(f"{FILE.name}, {table.get('id', 'a requirement')}: {error}") from None
    return Manual(found["groups"], tuple(rows), found["not_shown"])


# ---------------------------------------------------------------- marked tests


@functools.cache
def shown_by_tests(folder: Path = ROOT / "tests") -> Shown:
    """The tests that show each requirement; files without the marker are not parsed."""
    found: dict[str, list[ShowingTest]] = {}
    for path in sorted(folder.rglob("test_*.py")):
        source = path.read_text(encoding="utf-8")
        if MARKER in source:
            file = path.relative_to(folder.parent).as_posix()
            for requirement, test in marked(source, file):
                found.setdefault(requirement, []).append(test)
    return {requirement: tuple(tests) for requirement, tests in found.items()}


def marked(source: str, file: str) -> Iterator[tuple[str, ShowingTest]]:
    """Requirements and tests of one file's ``source``.

    Raises:
        ValueError: A marker is not the decorator of a test, or names no requirement.
    """
    tree = ast.parse(source)
    whole_file_is_long = "\npytestmark = pytest.mark.long\n" in source
    placed = 0
    for function in tree.body:
        if not isinstance(function, ast.FunctionDef) or not function.name.startswith("test_"):
            continue
        names = [ast.unparse(decorator) for decorator in function.decorator_list]
        is_long = whole_file_is_long or "pytest.mark.long" in names
        for decorator in function.decorator_list:
            if isinstance(decorator, ast.Call) and ast.unparse(decorator.func) == MARKER:
                placed += 1
                for argument in decorator.args:
                    test = ShowingTest(file, function.name, is_long)
                    yield str(ast.literal_eval(argument)), test
    if placed != source.count(MARKER):
        raise ValueError(f"{file}: {MARKER} is a decorator of a test in a file, and nothing else")


# ---------------------------------------------------------------- both directions


def problems(
    manual: Manual,
    shown: Shown,
    conditions: Collection[str] = CONDITIONS,
    checks: Collection[str] = ARMING_CHECKS,
) -> list[str]:
    """What does not fit: requirements against conditions, checks, files and marked tests."""
    return [
        *_of_requirements(manual, conditions, checks),
        *_left_out(manual, conditions, checks),
        *_of_tests(manual, shown),
    ]


def _of_requirements(
    manual: Manual, conditions: Collection[str], checks: Collection[str]
) -> Iterator[str]:
    ids = [row.id for row in manual.requirements]
    yield from (f"{one} stands twice" for one in sorted(set(ids)) if ids.count(one) > 1)
    for row in manual.requirements:
        group = _ID.fullmatch(row.id)
        if not group or group.group(1) not in manual.groups:
            yield f"{row.id} is to be REQ-GROUP-NUMBER with one of {', '.join(manual.groups)}"
        if "shall" not in row.shall or not row.shall.endswith("."):
            yield f"{row.id} is to be a sentence with shall"
        if "{after}" in row.shall and not row.conditions:
            yield f"{row.id} has no condition whose time {{after}} could be"
        if not (row.conditions or row.checks or row.by):
            yield f"{row.id} says of nothing that it implements it"
        yield from (
            f"{row.id} names no condition: {c}" for c in row.conditions if c not in conditions
        )
        yield from (f"{row.id} names no arming check: {c}" for c in row.checks if c not in checks)
        yield from (f"{row.id} names no file: {f}" for f in row.by if not (ROOT / f).exists())


def _left_out(
    manual: Manual, conditions: Collection[str], checks: Collection[str]
) -> Iterator[str]:
    for what, kind, named in (
        (conditions, "condition", {name for row in manual.requirements for name in row.conditions}),
        (checks, "arming check", {name for row in manual.requirements for name in row.checks}),
    ):
        yield from (f"{kind} {one} belongs to no requirement" for one in what if one not in named)


def _of_tests(manual: Manual, shown: Shown) -> Iterator[str]:
    ids = {row.id for row in manual.requirements}
    for one in sorted(ids - shown.keys() - manual.not_shown.keys()):
        yield f"{one} is shown by no test: mark one, or say in [not_shown] why there is none"
    for one in sorted(shown.keys() & manual.not_shown.keys()):
        yield f"{one} is shown by {shown[one][0].name}: take it out of [not_shown]"
    for one in sorted(shown.keys() - ids):
        yield f"{shown[one][0].name} ({shown[one][0].file}) shows {one}, which does not exist"
    for one in sorted(manual.not_shown.keys() - ids):
        yield f"[not_shown] has {one}, which does not exist"
