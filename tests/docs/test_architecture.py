"""The way into the code that docs/architecture.md shows is short enough to be gone."""

from __future__ import annotations

import re

from tests.docs.fences import DOCS, ROOT

PAGE = (DOCS / "architecture.md").read_text(encoding="utf-8")
MAX_LINES, MAX_FILES, MAX_CHANGES = 3_500, 15, 25  # lines, files, rows


def rows(heading: str) -> list[str]:
    """The first cells of the table below a heading that begins so."""
    section = PAGE.split(f"\n## {heading}")[1].split("\n## ")[0]
    return re.findall(r"^\| (?!…|file)(.+?) \|", section, re.MULTILINE)


def test_the_spine_is_read_in_one_evening() -> None:
    files = [ROOT / name.strip("`") for name in rows("The spine")]
    assert 10 <= len(files) <= MAX_FILES
    assert sum(len(one.read_text("utf-8").splitlines()) for one in files) <= MAX_LINES


def test_the_table_of_changes_fits_a_screen() -> None:
    assert 10 <= len(rows("I want to change")) <= MAX_CHANGES
