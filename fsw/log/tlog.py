"""The telemetry log: every frame of the ground link, in both directions.

A record is the time in microseconds (8 bytes, big-endian) and the frame, the `.tlog` that
QGroundControl, MAVProxy and pymavlink read. Stamps are the wall time of the start plus sensor
time, so that a flight in lockstep plays back at the speed at which it happened.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from messages.block_file import BlockFile

_FLUSH_INTERVAL_US: Final = 500_000
_FLUSH_BYTES: Final = 1 << 16


class TlogWriter:
    """Buffers records in memory; a thread writes them, so a slow disk cannot stop a tick.

    Whole records reach the file, so a process that is killed leaves a readable log.
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
