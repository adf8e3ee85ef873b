"""Where results go."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TextIO


def console_beside(target: str | None) -> TextIO:
    """Where sentences go: standard error if standard output is the JSON's."""
    return sys.stderr if target == "-" else sys.stdout


def write_text(target: str | None, text: str) -> None:
    """Write to the file of that name, to standard output for ``-``, nowhere for None."""
    if target == "-":
        sys.stdout.write(text)
        sys.stdout.flush()
    elif target is not None:
        Path(target).write_text(text, encoding="utf-8")


def unwritten(target: str | Path | None, text: str) -> list[str]:
    """Write to a target as ``write_text`` does; returns what could not be written, and why."""
    try:
        write_text(None if target is None else str(target), text)
    except BrokenPipeError:
        raise  # the reader has left
    except OSError as error:
        return [f"{'standard output' if target == '-' else target}: {error.strerror}"]
    return []
