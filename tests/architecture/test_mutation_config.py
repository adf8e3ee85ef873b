"""What mutation testing says of the product is still so; mutate.py itself checks more."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
CONFIG = tomllib.loads((ROOT / "tests/mutation/mutation.toml").read_text())


@pytest.mark.parametrize("entry", CONFIG["equivalent"], ids=lambda entry: entry["module"])
def test_every_line_of_the_list_exists(entry: dict[str, Any]) -> None:
    lines = {line.strip() for line in (ROOT / entry["module"]).read_text().splitlines()}
    assert set(entry["line"]) <= lines
    assert entry["reason"]


def public_functions(path: Path) -> set[str]:
    """Functions that a module defines, takes on from another one, or gives a name."""
    names = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.ImportFrom):
            names |= {alias.name for alias in node.names if alias.asname == alias.name}
        elif isinstance(node, ast.Assign):
            names |= {one.id for one in node.targets if isinstance(one, ast.Name)}
    return {name for name in names if not name.startswith("_") and name.islower()}


def test_what_stands_in_for_the_compiler_has_all_its_functions() -> None:
    stand_in = public_functions(ROOT / "tests/mutation/plain_compiled.py")
    assert stand_in == public_functions(ROOT / "fsw/compiled.py")


def test_every_folder_and_every_extra_test_exists() -> None:
    tests = [test for tests in CONFIG["extra_tests"].values() for test in tests]
    assert all((ROOT / name).exists() for name in (*CONFIG["folders"], *tests))
