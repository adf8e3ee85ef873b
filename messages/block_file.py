"""A file that grows by whole blocks, so that a killed process leaves a readable one.

In real time a thread writes: a slow disk must not stop a tick. What waits is bounded, and a block
that finds no room is dropped and counted. In lockstep the caller writes: then nothing can be
dropped and the file is the same on every machine. A disk that refuses ends the file, not the
flight; the reason is kept in ``failure``.

Whoever writes holds a lock on the file, so that nobody takes it for finished. The kernel gives it
back when the process ends, in whatever way.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import queue
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

Block = bytes | bytearray
Write = Callable[[int, memoryview], int]
"""``os.write``, or what a test puts in its place."""

_ROOM: Final = 64  # blocks that wait for the disk: 4 MiB, some ten seconds of a flight
_PATIENCE_S: Final = 5.0  # at the end, for a disk that is behind


class BlockFile:
    """Append-only; blocks are written in order, completely or not at all."""

    def __init__(self, path: Path, write: Write = os.write) -> None:
        """Create the file; ``write`` takes a file descriptor and bytes and says how many it wrote.

        Raises:
            OSError: The file exists or cannot be created.
        """
        self.path = path
        self.failure: str | None = None  # why nothing is written any more
        self.size = 0  # bytes written
        self.dropped = 0  # blocks that found no room
        self._write = write
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._waiting: queue.Queue[Block | None] = queue.Queue(maxsize=_ROOM)
        self._thread: threading.Thread | None = None
        self._closed = False

    @property
    def lost(self) -> list[str]:
        """What could not be written, and why, as ``try_write`` says it; empty: all of it was."""
        return [] if self.failure is None else [f"{self.path}: {self.failure}"]

    def start_thread(self) -> None:
        """From here on write in a thread of its own."""
        self._thread = threading.Thread(target=self._work, name=self.path.name, daemon=True)
        self._thread.start()

    def put(self, block: Block) -> bool:
        """Append a block, which must not be changed any more; False if it was dropped."""
        if self._thread is None:
            self._append(block)
            return True
        try:
            self._waiting.put_nowait(block)
        except queue.Full:
            self.dropped += 1
            return False
        return True

    def look(self) -> None:
        """Find out whether somebody has deleted the file: then what is written is lost."""
        if self.failure is None and not self._closed and os.fstat(self._file).st_nlink == 0:
            self.failure = "the file was deleted"

    def close(self) -> None:
        """Write what waits, as far as the disk takes it; safe to call twice."""
        if self._closed:
            return
        self._closed = True
        if self._thread is not None:
            try:
                self._waiting.put(None, timeout=_PATIENCE_S)
            except queue.Full:
                self.failure = self.failure or "the disk did not keep up"
                return  # the thread is stuck in the disk, and ends with the process
            self._thread.join(_PATIENCE_S)
            if self._thread.is_alive():
                self.failure = self.failure or "the disk did not keep up"
                return
        os.close(self._file)

    def _work(self) -> None:
        while (block := self._waiting.get()) is not None:
            self._append(block)

    def _append(self, block: Block) -> None:
        if self.failure is not None:
            return
        rest = memoryview(block)
        try:
            while rest:
                rest = rest[self._write(self._file, rest) :]
        except OSError as error:
            self.failure = error.strerror or str(error)
            # Part of the block may be there; a reader should find whole records only.
            os.ftruncate(self._file, self.size)
            return
        self.size += len(block)
