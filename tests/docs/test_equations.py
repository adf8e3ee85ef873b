"""docs/equations.md and the code cite each other: ids, files, both directions."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "equations.md"
SOURCES = sorted(path for half in ("fsw", "sitl") for path in (ROOT / half).rglob("*.py"))

_ID = r"[ET]\d+b?"
_PAPER = (*range(1, 9), *range(10, 19), *range(20, 24), 25, 29, 30)  # labels in its source


def sections() -> dict[str, str]:
    """Id -> text of its section."""
    parts = re.split(rf"^### ({_ID}) — ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def implementations() -> list[tuple[str, str]]:
    """(id, file) of every claim on the page."""
    return [
        (key, path)
        for key, text in sections().items()
        for line in re.findall(r"^- Implemented in: (.+)$", text, flags=re.MULTILINE)
        for path in re.findall(r"`([^`]+)`", line)
    ]


def cited(path: Path) -> set[str]:
    """Ids after ``docs/equations.md`` in a file: ``docs/equations.md E22, E23``."""
    text = path.read_text(encoding="utf-8")
    lists = re.findall(rf"docs/equations\.md ({_ID}(?:,\s+{_ID})*)", text)
    return {key for found in lists for key in re.findall(_ID, found)}


def test_every_equation_of_the_paper_has_a_section() -> None:
    of_paper = {key for key in sections() if key.startswith("E")}
    assert of_paper == {f"E{number}" for number in _PAPER} | {"E15b"}


def test_every_id_cited_in_code_is_on_the_page() -> None:
    known = set(sections())
    unknown = {str(path.relative_to(ROOT)): cited(path) - known for path in SOURCES}
    assert {path: ids for path, ids in unknown.items() if ids} == {}


@pytest.mark.parametrize(("key", "path"), implementations())
def test_the_file_that_implements_an_equation_cites_it(key: str, path: str) -> None:
    file = ROOT / path
    assert file.is_file(), f"{key}: {path} does not exist"
    assert key in cited(file), f'{path} should say "Source: docs/equations.md {key}"'


def test_every_file_named_on_the_page_exists() -> None:
    named = re.findall(r"`((?:fsw|sitl|tests|docs)/[\w/.-]+)`", PAGE.read_text(encoding="utf-8"))
    assert [path for path in named if not (ROOT / path).exists()] == []
