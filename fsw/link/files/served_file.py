"""Files that a ground station may read: on disk, or made by the program.

They are read within a tick, so nothing here waits for a disk.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeAlias

_PATIENCE: Final = 100  # refused reads in a row, a tick apart, before one waits for the disk
_READ_AHEAD: Final = 1 << 17  # bytes asked of the disk at once


@dataclass(frozen=True, slots=True)
class MemoryFile:
    """What the program has made; it is always open."""

    content: bytes

    @property
    def size(self) -> int:
        """Bytes it has."""
        return len(self.content)

    def open(self) -> MemoryFile:
        """Itself."""
        return self

    def read(self, offset: int, count: int) -> bytes:
        """Some of it."""
        return self.content[offset : offset + count]

    def close(self) -> None:
        """Nothing to give back."""


@dataclass(frozen=True, slots=True)
class DiskFile:
    """A regular file; a link, a directory or a pipe of this name is refused."""

    path: Path

    def status(self) -> os.stat_result:
        """Size and time as the system knows them; ``OSError`` if it is gone."""
        return self.path.stat(follow_symlinks=False)

    @property
    def size(self) -> int:
        """Bytes it has now; 0 if it is gone."""
        try:
            return self.status().st_size
        except OSError:
            return 0

    def open(self) -> OpenFile:
        """Open it; ``OSError`` if it is gone, cannot be read or is no regular file."""
        # O_NONBLOCK: to open a pipe would wait for its writer.
        descriptor = os.open(self.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            os.close(descriptor)
            raise OSError(errno.EINVAL, "not a regular file", str(self.path))
        return _Descriptor(descriptor, status.st_size)


class _Descriptor:
    def __init__(self, descriptor: int, size: int) -> None:
        self.size = size
        self._descriptor = descriptor
        self._refused = 0

    def read(self, offset: int, count: int) -> bytes | None:
        count = min(count, self.size - offset)
        if count <= 0:
            return b""
        if self._refused == _PATIENCE:
            self._refused = 0
            return os.pread(self._descriptor, count, offset)
        data = self._from_memory(offset, count)
        if len(data) == count:
            self._refused = 0
            return data
        if self._refused == 0:
            # The kernel fetches it while the vehicle flies on.
            os.posix_fadvise(self._descriptor, offset, _READ_AHEAD, os.POSIX_FADV_WILLNEED)
        self._refused += 1
        return None

    def _from_memory(self, offset: int, count: int) -> bytes:
        """As much as needs no disk."""
        buffer = bytearray(count)
        try:
            taken = os.preadv(self._descriptor, [buffer], offset, os.RWF_NOWAIT)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno != errno.EOPNOTSUPP:
                raise
            return os.pread(self._descriptor, count, offset)  # a file system in memory
        return bytes(buffer[:taken])

    def close(self) -> None:
        os.close(self._descriptor)
        self._descriptor = -1  # the system gives the number to the next file


ServedFile = MemoryFile | DiskFile
"""Something that can be listed, and opened at the size it has now."""

OpenFile = MemoryFile | _Descriptor
"""A file whose size does not change any more, whatever is appended to it.

It is read inside that size; None means that the disk has not delivered yet: ask at the next tick.
"""

Node: TypeAlias = "ServedFile | Mapping[str, Node]"
Directory: TypeAlias = Mapping[str, Node]
"""A tree of names, as a ground station sees it over FTP."""
