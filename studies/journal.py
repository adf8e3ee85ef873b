"""An append-only journal: one JSON object a line, on disk before anything else goes on."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any


class Journal:
    """Appends lines to a file, which stays open."""

    def __init__(self, path: Path) -> None:
        """Open or make it.

        Raises:
            OSError: It cannot be written.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("ab")
        if self._file.tell() and not _ends_a_line(path):
            self._file.write(b"\n")  # after a line that a crash cut short

    def append(self, contents: Iterable[Mapping[str, Any]]) -> None:
        """Add lines; they are on the disk when this returns."""
        self._file.write(b"".join(json.dumps(one).encode() + b"\n" for one in contents))
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def lines(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of a journal, oldest first; one that a crash cut short is left out."""
    if not path.exists():
        return
    with path.open("rb") as file:
        for line in file:
            try:
                content = json.loads(line)
            except ValueError:
                continue
            if isinstance(content, dict):
                yield content


def _ends_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"
