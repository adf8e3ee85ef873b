"""Where a flight puts its files."""

from __future__ import annotations

from itertools import count
from pathlib import Path


def run_directory(wanted: Path | None, stem: str) -> Path:
    """The directory for a flight's files: the wanted one, made if need be, or a new one in runs/.

    Raises:
        OSError: It cannot be created, or holds a flight already.
    """
    if wanted is None:
        return new_run_directory(Path("runs"), stem)
    wanted.mkdir(parents=True, exist_ok=True)
    if any((wanted / name).exists() for name in ("result.json", "flight.tlog", "flight.ulg")):
        raise FileExistsError(f"{wanted} already holds a flight; name another --out")
    return wanted


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
