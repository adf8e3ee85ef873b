"""The logs of one flight together: opened, watched and closed."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from fsw.log.flight_log import FlightLog, LogSubject
from messages.block_file import BlockFile

_FLUSH_INTERVAL_US: Final = 500_000
_FLUSH_BYTES: Final = 1 << 16


class TlogWriter:
    """The telemetry log, ``.tlog``: every frame of the ground link, in both directions.

    A record is the time in microseconds (8 bytes, big-endian) and the frame. Stamps are the wall
    time of the start plus sensor time, so that a flight in lockstep plays back at the speed at
    which it happened. A thread writes, so a slow disk cannot stop a tick; whole records reach the
    file, so a process that is killed leaves a readable log.
    """

    def __init__(self, path: Path, start_unix_us: int) -> None:
        """Create the file; sensor time 0 is stamped with ``start_unix_us``.

        Raises:
            OSError: The file exists or cannot be created.
        """
        self.file = BlockFile(path)
        self.file.start_thread()
        self._start_us = start_unix_us
        self._records = bytearray()
        self._flushed_us = 0

    def add(self, t_us: int, frame: bytes) -> None:
        """Append one whole MAVLink frame."""
        self._records += (self._start_us + t_us).to_bytes(8, "big") + frame
        if t_us - self._flushed_us >= _FLUSH_INTERVAL_US or len(self._records) > _FLUSH_BYTES:
            self._flushed_us = t_us
            self._flush()

    def close(self) -> None:
        """Write what is left and close the file; safe to call twice."""
        self._flush()
        self.file.close()

    def _flush(self) -> None:
        if self._records:
            self.file.put(self._records)
            self._records = bytearray()


class RunFiles:
    """``flight.ulg`` and ``flight.tlog``. A disk error is reported once per file."""

    def __init__(
        self,
        directory: Path,
        start_unix_us: int,
        subject: LogSubject,
        warn: Callable[[str], None],
    ) -> None:
        """Create both files in a directory that exists; sensor time 0 is ``start_unix_us``.

        Raises:
            OSError: A file exists or cannot be created.
        """
        self.ulog = FlightLog(directory / "flight.ulg", subject)
        self.tlog = TlogWriter(directory / "flight.tlog", start_unix_us)
        self._warn = warn
        self._reported: set[str] = set()
        self._dropped = 0  # blocks, when it was last asked for

    def check(self) -> None:
        """Report what went wrong since the last call; cheap."""
        for file in self._files():
            file.look()
            if file.failure is not None:
                self._report(_ends_early(file))
            elif file.dropped:
                self._report(f"{file.path.name} has gaps: the disk does not keep up")

    def failure(self) -> str:
        """What is wrong with the files now, in a sentence; empty: they are written."""
        for file in self._files():
            if file.failure is not None:
                return _ends_early(file)
        before, self._dropped = self._dropped, sum(file.dropped for file in self._files())
        return "the log has gaps: the disk does not keep up" if self._dropped > before else ""

    @property
    def lost(self) -> list[str]:
        """Files that end early, and why."""
        return [one for file in self._files() for one in file.lost]

    @property
    def size(self) -> int:
        """Bytes written of both files."""
        return sum(file.size for file in self._files())

    def room(self) -> int:
        """Bytes that the disk will take."""
        disk = os.statvfs(self.ulog.file.path.parent)
        return disk.f_bavail * disk.f_frsize

    def close(self) -> None:
        """Write what is left; safe to call twice."""
        self.check()  # a closed file no longer tells that it was deleted
        self.ulog.close()
        self.tlog.close()
        self.check()

    def as_json(self) -> dict[str, object]:
        """What became of the files, for ``fsw.json``."""
        described: dict[str, object] = {
            file.path.name: {
                "bytes": file.size,
                "dropped_blocks": file.dropped,
                "failure": file.failure,
            }
            for file in self._files()
        }
        return {
            **described,
            "lost_ms": round(1e-3 * self.ulog.lost_us),
            "unwritten_ticks": self.ulog.unwritten_ticks,
        }

    def _files(self) -> tuple[BlockFile, BlockFile]:
        return self.ulog.file, self.tlog.file

    def _report(self, sentence: str) -> None:
        if sentence not in self._reported:
            self._reported.add(sentence)
            self._warn(sentence)


def _ends_early(file: BlockFile) -> str:
    return f"{file.path.name} ends early: {file.failure}"
