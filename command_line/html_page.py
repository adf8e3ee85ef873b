"""A self-contained HTML page: what every page of ours is set in."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

# A rotor from above, blue and white.
ICON: Final = (
    "data:image/svg+xml,%3Csvg xmlns=%27http://www.w3.org/2000/svg%27 viewBox=%270 0 16 16%27%3E"
    "%3Ccircle cx=%278%27 cy=%278%27 r=%277%27 fill=%27%230969da%27/%3E%3Cpath d=%27M3 8h10M8 3v10"
    "%27 stroke=%27white%27 stroke-width=%272%27/%3E%3C/svg%3E"
)
_STYLE: Final = Path(__file__).with_suffix(".css")


def document(title: str, parts: Iterable[str], style: str = "", head: str = "") -> str:
    """The page: its title in plain text, its parts and what else its head holds as HTML."""
    css = _STYLE.read_text(encoding="utf-8") + style
    body = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<link rel='icon' href='{ICON}'>\n"
        f"{head}<title>{html.escape(title)}</title>\n<style>\n{css}</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


def verdict(passed: bool, sentence: str) -> str:
    """What a page comes down to, in plain text."""
    word, style = ("PASS", "passed") if passed else ("FAIL", "failed")
    return f'<p class="verdict {style}"><b>{word}</b> {html.escape(sentence)}</p>'


def items(sentences: Iterable[str]) -> str:
    """A list of sentences in plain text."""
    return "<ul>" + "".join(f"<li>{html.escape(line)}</li>" for line in sentences) + "</ul>"


def table(headers: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> str:
    """A table of plain text; ``headers`` may be empty."""
    named = f"<caption>{html.escape(caption)}</caption>" if caption else ""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in headers)
    body = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table>{named}<thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>"
