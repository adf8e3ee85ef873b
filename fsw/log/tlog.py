"""The telemetry log: every frame of the ground link, in both directions.

A record is the time in microseconds (8 bytes, big-endian) and the frame, the `.tlog` that
QGroundControl, MAVProxy and pymavlink read. Stamps are the wall time of the start plus sensor
time, so that a flight in lockstep plays back at the speed at which it happened.
"""

from __future__ import annotations

import queue
import threading
from pathlib import Path
from typing import Final

_FLUSH_INTERVAL_US: Final = 500_000
_FLUSH_BYTES: Final = 1 << 16


class TlogWriter:
    """Buffers records in memory; a thread writes them, so a slow disk cannot stop a tick.

    Whole records reach the file, so a process that is killed leaves a readable log.
    """

    def __init__(self, path: Path, start_unix_us: int) -> None:
        """Create the file.

        Args:
            path: Where to write; must not exist.
            start_unix_us: Wall time that sensor time 0 is stamped with [us since 1970].

        Raises:
            OSError: The file exists or cannot be created.
        """
        self._file = path.open("xb", buffering=0)
        self._start_us = start_unix_us
        self._records = bytearray()
        self._flushed_us = 0
        self._full: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._writer = threading.Thread(target=self._write, name="tlog", daemon=True)
        self._writer.start()

    def add(self, t_us: int, frame: bytes) -> None:
        """Append one frame.

        Args:
            t_us: Sensor time [us].
            frame: One whole MAVLink frame.
        """
        self._records += (self._start_us + t_us).to_bytes(8, "big") + frame
        if t_us - self._flushed_us >= _FLUSH_INTERVAL_US or len(self._records) > _FLUSH_BYTES:
            self._flushed_us = t_us
            self._full.put(bytes(self._records))
            self._records.clear()

    def close(self) -> None:
        """Write what is left and close the file; safe to call twice."""
        if self._file.closed:
            return
        self._full.put(bytes(self._records))
        self._full.put(None)
        self._writer.join()
        self._file.close()

    def _write(self) -> None:
        while (records := self._full.get()) is not None:
            self._file.write(records)
