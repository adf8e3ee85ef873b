"""The fenced blocks of the documentation, and what a comment above one says about running it.

A block is run by ``make test`` unless the line above it says otherwise::

    <!-- long: flies 120 s -->                   run by make test-long and make docs-test
    <!-- not run: needs a display -->            only read: its commands and options must exist
    <!-- run in: tests/interop/test_pages.py --> another test runs it
    <!-- added to: scenario.toml -->             appended to a file that an earlier block wrote
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = (
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "messages" / "README.md",
    # docs/reference/api and the pages of notebooks are written by Sphinx.
    *sorted(page for page in DOCS.rglob("*.md") if page.parent.name not in ("api", "notebooks")),
)
MARKS = ("long", "not run", "run in", "added to")
_OPEN = re.compile(r"^(`{3,})\s*(\S*)")


@dataclass(frozen=True)
class Fence:
    """One fenced block."""

    page: Path
    line: int  # of the opening fence, from 1
    language: str
    text: str
    mark: str = ""  # one of MARKS, or empty
    reason: str = ""

    def __str__(self) -> str:
        return f"{named(self.page)}:{self.line}"


def named(path: Path) -> str:
    """The path as a reader of the repository writes it."""
    return path.relative_to(ROOT).as_posix()


def fences(page: Path) -> list[Fence]:
    """Every fenced block of a page, in order."""
    lines = page.read_text(encoding="utf-8").splitlines()
    found, at = [], 0
    while at < len(lines):
        opened = _OPEN.match(lines[at])
        if not opened:
            at += 1
            continue
        end = next(k for k in range(at + 1, len(lines)) if lines[k].strip() == opened.group(1))
        mark, reason = _mark(lines[at - 1]) if at else ("", "")
        body = "".join(f"{line}\n" for line in lines[at + 1 : end])
        found.append(Fence(page, at + 1, opened.group(2), body, mark, reason))
        at = end + 1
    return found


def without_fences(page: Path) -> str:
    """The prose of a page."""
    return re.sub(r"^(`{3,}).*?^\1$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)


def commands(fence: Fence) -> list[tuple[str, str]]:
    """(command, expected output) of each prompt of a console block."""
    found: list[tuple[str, str]] = []
    for line in fence.text.replace("\\\n", "").splitlines():
        if line.startswith(("$ ", "# ")):
            found.append((line[2:], ""))
        else:
            command, output = found.pop()
            found.append((command, f"{output}{line}\n"))
    return found


def _mark(line: str) -> tuple[str, str]:
    found = re.match(rf"<!-- ({'|'.join(MARKS)}): (.+) -->$", line)
    return (found.group(1), found.group(2)) if found else ("", "")
