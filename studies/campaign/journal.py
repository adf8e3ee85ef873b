"""An append-only journal: one JSON object a line, on disk before anything else goes on.

Each line ends with a digest, the SHA-256 of the digest before it and of the line without its own: a
chain. A line that was edited, removed, moved, repeated or taken from elsewhere breaks it, and so
does what stands after a cut. Who knows this can write another chain: what the digests show is that
a journal is as it was written, not by whom. To fly its rows again shows that.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

from command_line.bounded_file import open_regular
from command_line.bounded_json import JsonError, json_object

MAX_LINE: Final = 1 << 20  # bytes; a flight of the fault matrix with all its texts has some 20 kB
_NO_LOCKS: Final = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)  # of a file system
_BEGINS: Final = b'{"key": "'  # each line
_FIRST: Final = hashlib.sha256(b"pandion-journal-1").hexdigest()  # before the first line
_SEALED: Final = re.compile(rb'(.*), "digest": "([0-9a-f]{64})"\}\n', re.DOTALL)


class JournalError(OSError):
    """A journal that cannot be used, in one sentence."""


class JournalInUseError(JournalError):
    """Another process, or another part of this one, writes to it."""


@dataclass(frozen=True, slots=True)
class Seal:
    """What a journal is held against: how many lines it has, and the digest of the last."""

    lines: int = 0
    digest: str = _FIRST

    def after(self, body: bytes) -> Seal:
        """The seal with one more line, given as an object without its digest and ``}``."""
        chained = hashlib.sha256(self.digest.encode() + body).hexdigest()
        return Seal(self.lines + 1, chained)


class Journal:
    """Lines with a ``key``; of each key the last line without an ``error`` can be read again."""

    def __init__(self, path: Path) -> None:
        """Open or make it; nobody else can until it is closed.

        Raises:
            JournalInUseError: Somebody else has it open.
            JournalError: A line does not verify.
            OSError: It cannot be written, or is no regular file.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = open_regular(path, append=True, follow=False)
        self._place: dict[str, int] = {}  # in the file; rows themselves would fill the memory
        self.seal = Seal()
        try:
            _lock(self._file, path)
            end = 0
            for content, seal, length in _verified(self._file, path, mends=True):
                self._index(content, end)
                self.seal, end = seal, end + length
            self._file.truncate(end)  # a line that a crash cut short
        except BaseException:
            self._file.close()
            raise

    def get(self, key: str) -> dict[str, Any] | None:
        """What was kept under a key; None if nothing was."""
        place = self._place.get(key)
        if place is None:
            return None
        self._file.seek(place)
        content = _object(self._file.readline(MAX_LINE))
        if content is None or content.pop("key", None) != key:
            return None  # the file was changed by something that asks for no lock
        return content

    def append(self, contents: Iterable[tuple[str, Mapping[str, Any]]]) -> None:
        """Add lines under their keys; they are on the disk when this returns."""
        place = self._file.seek(0, os.SEEK_END)
        for key, content in contents:
            body = json.dumps({"key": key, **content}).encode()[:-1]
            self.seal = self.seal.after(body)
            line = b'%b, "digest": "%b"}\n' % (body, self.seal.digest.encode())
            self._file.write(line)
            self._index({"key": key, **content}, place)
            place += len(line)
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _index(self, content: Mapping[str, Any], place: int) -> None:
        key = content.get("key")
        if isinstance(key, str) and content.get("error") is not True:
            self._place[key] = place


def lines(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of a journal, oldest first; see :func:`sealed_lines`."""
    return (content for content, _ in sealed_lines(path))


def sealed_lines(path: Path) -> Iterator[tuple[dict[str, Any], Seal]]:
    """The lines of a journal, oldest first, and the seal up to each; none if there is no file.

    Raises:
        JournalError: A line does not verify, or the file grows while it is read.
        OSError: It cannot be read, or is no regular file.
    """
    try:
        file = open_regular(path, follow=False)
    except FileNotFoundError:
        return
    with file:
        for content, seal, _ in _verified(file, path, mends=False):
            yield content, seal


def _verified(
    file: BinaryIO, path: Path, *, mends: bool
) -> Iterator[tuple[dict[str, Any], Seal, int]]:
    """Content, seal and length of each line, up to the length that the file has now.

    A last line that a crash cut short is left out for whoever ``mends`` it, and refused else.
    """
    length = os.fstat(file.fileno()).st_size
    seal, place = Seal(), 0
    file.seek(0)
    while place < length:
        line = file.readline(MAX_LINE)
        place += len(line)
        if not line.endswith(b"\n"):
            if mends and len(line) < MAX_LINE and line[: len(_BEGINS)] == _BEGINS[: len(line)]:
                break
            raise _damaged(path, seal, "has no end: it was cut short, or is still being written")
        found = _SEALED.fullmatch(line)
        content = None if found is None else _object(line)
        if found is None or content is None:
            raise _damaged(path, seal, "is none that a campaign of this version writes")
        seal, before = seal.after(found[1]), seal
        if seal.digest.encode() != found[2]:
            raise _damaged(path, before, "was edited or moved, or one before it is missing")
        yield content, seal, len(line)
    if os.fstat(file.fileno()).st_size != length:
        raise JournalError(f"{path} changes while it is read: wait for the end of what writes it")


def _damaged(path: Path, good: Seal, what: str) -> JournalError:
    rest = "give another place"
    if good.lines:
        rest = f"keep the {good.lines} lines before it, which verify, and go on with what flew them"
    return JournalError(f"{path}, line {good.lines + 1} {what}: {rest}")


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
    """What a line holds, without its digest; None if it is cut short or damaged.

    A flight that diverged has a margin that is no number, and is not to be lost for that.
    """
    try:
        content = json_object(line, not_finite=True)
    except JsonError:
        return None
    content.pop("digest", None)
    return content
