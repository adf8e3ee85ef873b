"""Where a flight puts its files."""

from __future__ import annotations

from itertools import count
from pathlib import Path


def new_run_directory(parent: Path, stem: str) -> Path:
    """Create ``parent/stem-1``, or the next number that is free; nothing is ever overwritten.

    Raises:
        OSError: The directory cannot be created.
    """
    parent.mkdir(parents=True, exist_ok=True)
    for number in count(1):
        directory = parent / f"{stem}-{number}"
        try:
            directory.mkdir()
        except FileExistsError:
            continue
        return directory
    raise AssertionError("count() does not end")
