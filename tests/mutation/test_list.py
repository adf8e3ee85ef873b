"""The list of mutants that no test kills is of lines that there are: make mutate is run seldom."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.mutation.functions import Span, enclosing, not_run

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
ENTRIES = tomllib.loads((HERE / "mutation.toml").read_text(encoding="utf-8"))["equivalent"]
# Of what a mutant changes something: a number, an operator, a word.
_CAN_CHANGE = re.compile(
    r"\d|[-+*/%<>|&]|[!=]=|\b(and|assert|break|continue|for|if|is|not|or|while|True|False)\b"
    r"|\b(min|max)(imum)?\("
)


@pytest.mark.parametrize(
    "entry", ENTRIES, ids=lambda entry: f"{entry['module']} {entry['function']}"
)
def test_a_listed_mutant_is_of_a_line_that_its_function_has(entry: dict[str, Any]) -> None:
    source = (ROOT / entry["module"]).read_text(encoding="utf-8")
    functions, skipped = enclosing(ast.parse(source)), not_run(ast.parse(source))
    there = {
        line.strip()
        for number, line in enumerate(source.splitlines(), start=1)
        if ([name for first, last, name in functions if first <= number <= last] or [""])[-1]
        == entry["function"]
        and _CAN_CHANGE.search(_run(line, number, skipped))
    }
    assert not set(entry["line"]) - there
    for mutated in entry.get("mutated", ()):
        # One token is another: what is left of the line begins and ends as it was.
        assert any(_shared(mutated, line) >= len(line) // 2 for line in entry["line"])


def _run(line: str, number: int, skipped: list[Span]) -> str:
    """What is left of a line without what is never changed, as annotations are not."""
    places = range(len(line))
    return "".join(
        line[k] for k in places if not any(low <= (number, k) < high for low, high in skipped)
    )


def _shared(one: str, other: str) -> int:
    """Characters that two lines have in common at their beginnings and ends."""
    same = 0
    for a, b in ((one, other), (one[::-1], other[::-1])):
        same += next((k for k, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), len(b))
    return same


def test_every_other_path_of_the_list_exists() -> None:
    config = tomllib.loads((HERE / "mutation.toml").read_text(encoding="utf-8"))
    extra = config["extra_tests"]
    for path in (*config["folders"], *extra, *(test for tests in extra.values() for test in tests)):
        assert (ROOT / path).exists(), path
