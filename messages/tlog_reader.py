"""Reading a telemetry log (``.tlog``): a time and a MAVLink frame, again and again.

Source: what QGroundControl and MAVProxy write, and ``fsw/log/tlog.py``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from messages.frames import Frame, cut

_STAMP: Final = 8  # bytes before each frame: microseconds, big-endian
_SIGNATURE: Final = 13
_MAGIC_1, _MAGIC_2 = 0xFE, 0xFD
_MARKER: Final = re.compile(b"[\xfe\xfd]")
_MOST_UNKNOWN: Final = 4  # frames of unknown messages in a row
_MOST_FAILED: Final = 2_000  # markers in a row that begin no frame: what follows is no log


class TlogFrames:
    """Every frame of a log with its time [s]; what is no frame is skipped and counted.

    A frame of an unknown message, which no checksum can vouch for, is stepped over where another
    one follows it.
    """

    def __init__(self, log: bytes) -> None:
        self._log = log
        self.skipped = 0  # bytes so far

    def __iter__(self) -> Iterator[tuple[float, Frame]]:
        log, at, failed = self._log, 0, 0
        while at + _STAMP + 3 <= len(log) and failed < _MOST_FAILED:
            start = at + _STAMP
            end = start + self._size(start)
            found = next(cut(log[start:end]), None)
            if found is not None and len(found[1]) == end - start:
                yield 1e-6 * int.from_bytes(log[at:start], "big"), found[0]
                at, failed = end, 0
            elif found is None and end > start and self._follows(end):
                at, failed = end, 0
            else:
                marker = _MARKER.search(log, start + 1)
                further = len(log) if marker is None else marker.start() - _STAMP
                self.skipped += further - at
                at, failed = further, failed + 1
        self.skipped += len(log) - at

    def _size(self, start: int) -> int:
        """Bytes of the frame that begins at ``start``; 0: none does, or it is cut."""
        log, size = self._log, 0
        if log[start] == _MAGIC_2:
            size = 12 + log[start + 1] + _SIGNATURE * (log[start + 2] & 1)
        elif log[start] == _MAGIC_1:
            size = 8 + log[start + 1]
        return size if start + size <= len(log) else 0

    def _follows(self, end: int) -> bool:
        """Whether what cannot be checked ends at ``end``, where a frame that can be begins.

        A few that cannot may lie between, or the log may end there.
        """
        for _ in range(_MOST_UNKNOWN):
            if end == len(self._log):
                return True
            start = end + _STAMP
            end = start + (self._size(start) if start < len(self._log) else 0)
            if end == start:
                return False
            found = next(cut(self._log[start:end]), None)
            if found is not None:
                return len(found[1]) == end - start
        return False


def tlog_frames(log: bytes) -> Iterator[tuple[float, Frame]]:
    """Every frame of a log with its time [s]."""
    return iter(TlogFrames(log))
