"""The list of mutants that no test can kill is about lines that exist; mutate.py checks more."""

from __future__ import annotations

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


def test_every_folder_and_every_extra_test_exists() -> None:
    tests = [test for tests in CONFIG["extra_tests"].values() for test in tests]
    assert all((ROOT / name).exists() for name in (*CONFIG["folders"], *tests))
