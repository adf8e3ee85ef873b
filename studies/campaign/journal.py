"""An append-only journal: one JSON object a line, on disk before anything else goes on."""

from __future__ import annotations

import errno
import fcntl
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final

from command_line.bounded_file import open_regular
from command_line.bounded_json import JsonError, json_object

_NO_LOCKS: Final = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)  # of a file system


class JournalInUseError(OSError):
    """Another process, or another part of this one, writes to it; in one sentence."""


class Journal:
    """Lines with a ``key``; of each key the last line without an ``error`` can be read again."""

    def __init__(self, path: Path) -> None:
        """Open or make it; nobody else can until it is closed.

        Raises:
            JournalInUseError: Somebody else has it open.
            OSError: It cannot be written.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = open_regular(path, append=True)
        try:
            _lock(self._file, path)
        except BaseException:
            self._file.close()
            raise
        self._place: dict[str, int] = {}  # in the file; rows themselves would fill the memory
        self._file.seek(0)
        end, whole = 0, True
        for line in self._file:
            self._index(_object(line), end)
            end += len(line)
            whole = line.endswith(b"\n")
        if not whole:
            self._file.write(b"\n")  # after a line that a crash cut short

    def get(self, key: str) -> dict[str, Any] | None:
        """What was kept under a key; None if nothing was."""
        place = self._place.get(key)
        if place is None:
            return None
        self._file.seek(place)
        content = _object(self._file.readline())
        if content is None or content.pop("key", None) != key:
            return None  # the file was changed by something that asks for no lock
        return content

    def append(self, contents: Iterable[tuple[str, Mapping[str, Any]]]) -> None:
        """Add lines under their keys; they are on the disk when this returns."""
        place = self._file.seek(0, os.SEEK_END)
        for key, content in contents:
            line = json.dumps({"key": key, **content}).encode() + b"\n"
            self._file.write(line)
            self._index({"key": key, **content}, place)
            place += len(line)
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _index(self, content: Mapping[str, Any] | None, place: int) -> None:
        if content is None or content.get("error") is True:
            return
        key = content.get("key")
        if isinstance(key, str):
            self._place[key] = place


def lines(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of a journal, oldest first; one that is cut short or damaged is left out."""
    if not path.exists():
        return
    with open_regular(path) as file:
        for line in file:
            content = _object(line)
            if content is not None:
                yield content


def _lock(file: BinaryIO, path: Path) -> None:
    """Keep others out until the file is closed, or this process ends in whatever way."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _NO_LOCKS:
            return  # it is still right for one writer
        if error.errno not in (errno.EAGAIN, errno.EACCES):
            raise
        raise JournalInUseError(
            f"{path} is being written by another process: wait for its end, or give another place"
        ) from None


def _object(line: bytes) -> dict[str, Any] | None:
    """What a line holds; None if it is cut short or damaged.

    A flight that diverged has a margin that is no number, and is not to be lost for that.
    """
    try:
        return json_object(line, not_finite=True)
    except JsonError:
        return None
