"""Reading a telemetry log (``.tlog``): a time and a MAVLink frame, again and again.

Source: what QGroundControl and MAVProxy write, and ``fsw/log/flight_log.py``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from messages.frames import Frame, cut, frame_at

_STAMP: Final = 8  # bytes before each frame: microseconds, big-endian
_SIGNATURE: Final = 13
_MAGIC_1, _MAGIC_2 = 0xFE, 0xFD
_MARKER: Final = re.compile(b"[\xfe\xfd]")
_MAX_UNKNOWN: Final = 4  # frames of unknown messages in a row
_MAX_FAILED: Final = 1_000_000  # markers in a row that begin no frame: seconds of looking


class TlogFrames:
    """Every frame of a log with its time [s]; what is no frame is skipped and counted.

    A frame of an unknown message, which no checksum can vouch for, is stepped over where another
    one follows it.
    """

    def __init__(self, log: bytes) -> None:
        self._log = log
        self.skipped = 0  # bytes so far
        self.unread = 0  # bytes at the end that nobody has looked at: too much before was no frame

    def __iter__(self) -> Iterator[tuple[float, Frame]]:
        log, at, failed = self._log, 0, 0
        while at + _STAMP + 3 <= len(log) and failed < _MAX_FAILED:
            start = at + _STAMP
            length, frame = frame_at(log, start)
            end = start + self._size(start)
            if frame is not None:
                yield 1e-6 * int.from_bytes(log[at:start], "big"), frame
                at, failed = start + length, 0
            elif end > start and self._follows(end) and next(cut(log[start:end]), None) is None:
                at, failed = end, 0
            else:
                marker = _MARKER.search(log, start + 1)
                further = len(log) if marker is None else marker.start() - _STAMP
                self.skipped += further - at
                at, failed = further, failed + 1
        self.unread = len(log) - at if failed == _MAX_FAILED else 0
        self.skipped += len(log) - at - self.unread

    def _size(self, start: int) -> int:
        """Bytes of the frame that begins at ``start``; 0: none does, or it is cut."""
        head, size = self._log[start : start + 3], 0
        if len(head) == 3 and head[0] == _MAGIC_2:
            size = 12 + head[1] + _SIGNATURE * (head[2] & 1)
        elif len(head) == 3 and head[0] == _MAGIC_1:
            size = 8 + head[1]
        return size if start + size <= len(self._log) else 0

    def _follows(self, end: int) -> bool:
        """Whether what cannot be checked ends at ``end``, where a frame that can be begins.

        A few that cannot may lie between, or the log may end there.
        """
        for _ in range(_MAX_UNKNOWN):
            if end == len(self._log):
                return True
            start = end + _STAMP
            end = start + self._size(start)
            if end == start:
                return False
            if frame_at(self._log, start)[1] is not None:
                return True
        return False


def tlog_frames(log: bytes) -> Iterator[tuple[float, Frame]]:
    """Every frame of a log with its time [s]."""
    return iter(TlogFrames(log))
