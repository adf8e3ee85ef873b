"""Parameters, messages and status texts that the pages name are those of the vehicle."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from fsw.autopilot.parameters.facts import FACTS
from fsw.autopilot.parameters.registry import PARAMETERS
from messages import dialect
from tests.docs.fences import DOCS, PAGES, ROOT, named, without_fences

PARAMETER_NAMES = {p.name for p in PARAMETERS} | {fact.name for fact in FACTS}
MESSAGE_NAMES = {message.msgname for message in dialect.mavlink_map.values()}
CONSTANTS = {
    name.removeprefix("MAV_CMD_") for entries in dialect.enums.values() for name in
    (entry.name for entry in entries.values())
} | set(dialect.enums)  # fmt: skip
# The changelog names what is gone, the page of messages is generated, and that of differences from
# PX4 lists messages that this vehicle does not have.
SKIPPED = (
    "CHANGELOG.md",
    "docs/reference/messages.md",
    "docs/reference/px4-differences.md",
)
READ = [page for page in PAGES if named(page) not in SKIPPED]


def prefixes() -> set[str]:
    return {name.split("_")[0] for name in PARAMETER_NAMES}


@pytest.mark.parametrize("page", READ, ids=named)
def test_a_parameter_on_a_page_exists(page: Path) -> None:
    """Names in backticks that look like a parameter; a star stands for several."""
    quoted = re.findall(r"`([A-Z][A-Z0-9]+_[A-Z0-9_*]+)`", without_fences(page))
    unknown = [
        name
        for name in quoted
        if name.split("_")[0] in prefixes()
        and not any(re.fullmatch(name.replace("*", ".*"), known) for known in PARAMETER_NAMES)
    ]
    assert unknown == []


@pytest.mark.parametrize("page", READ, ids=named)
def test_a_message_or_command_on_a_page_exists(page: Path) -> None:
    """Words in capitals with an underscore, outside code: messages, commands, enumerations."""
    text = re.sub(r"`[^`]*`|\]\([^)]*\)|<!--.*?-->", "", without_fences(page), flags=re.S)
    words = set(re.findall(r"\b[A-Z][A-Z0-9]+(?:_[A-Z0-9]+)+\b(?!\*)", text))
    known = MESSAGE_NAMES | CONSTANTS | PARAMETER_NAMES | OTHER
    assert sorted(word for word in words if word not in known) == []


# Of Linux, of PX4's simulator, of the dialect's own definition.
OTHER = {
    "SCHED_FIFO", "SCHED_OTHER", "PREEMPT_RT", "SOCK_SEQPACKET", "RWF_NOWAIT", "CRC_EXTRA",
    "INVALID_ARGUMENT",
}  # fmt: skip


def status_text_forms() -> list[str]:
    """What the page has status texts begin with."""
    page = (DOCS / "reference" / "status-texts.md").read_text(encoding="utf-8")
    forms = page.split("## Forms")[1]
    return [
        text
        for row in re.findall(r"^\| (`.*?) \|", forms, re.M)
        for text in re.findall(r"`([^`]{4,})`", row)
    ]


def status_text_beginnings(path: Path) -> list[str]:
    """What status texts of a file begin with, where it is written in their call and has a colon."""
    found = []
    for call in ast.walk(ast.parse(path.read_text("utf-8"))):
        if not isinstance(call, ast.Call) or len(call.args) < 2:
            continue
        if ast.unparse(call.func) not in ("StatusText", "self._tell", "self._say"):
            continue
        text = call.args[1]
        first = text.values[0] if isinstance(text, ast.JoinedStr) else text
        if isinstance(first, ast.Constant) and isinstance(first.value, str):
            found.append(first.value)
    return [text for text in found if ":" in text]


def test_the_beginnings_of_status_texts_occur_in_the_code() -> None:
    quoted = status_text_forms()
    code = "\n".join(path.read_text("utf-8") for path in (ROOT / "fsw").rglob("*.py"))
    assert quoted
    assert [text for text in quoted if text.removesuffix(" N") not in code] == []


def test_the_beginnings_of_status_texts_in_the_code_are_on_the_page() -> None:
    """A beginning that is put together elsewhere is not looked for."""
    forms = tuple(text.removesuffix(" N") for text in status_text_forms())
    written = [
        text for path in (ROOT / "fsw").rglob("*.py") for text in status_text_beginnings(path)
    ]
    assert "reference limited: " in written
    assert [text for text in written if not text.startswith(forms)] == []
