"""Reading a telemetry log (``.tlog``): a time and a MAVLink frame, again and again.

Source: what QGroundControl and MAVProxy write, and ``fsw/log/tlog.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from messages.frames import Frame, cut

_STAMP: Final = 8  # bytes before each frame: microseconds, big-endian
_SIGNATURE: Final = 13
_MAGIC_1, _MAGIC_2 = 0xFE, 0xFD
_MAGICS: Final = (_MAGIC_1, _MAGIC_2)


class TlogFrames:
    """Every frame of a log with its time [s]; what is no frame is skipped and counted.

    A frame of an unknown message, which no checksum can vouch for, is stepped over where another
    one follows it.
    """

    def __init__(self, log: bytes) -> None:
        self._log = log
        self.skipped = 0  # bytes so far

    def __iter__(self) -> Iterator[tuple[float, Frame]]:
        log, at = self._log, 0
        while at + _STAMP + 3 <= len(log):
            start = at + _STAMP
            end = start + self._size(start)
            found = next(cut(log[start:end]), None) if end > start else None
            # A frame that begins further on is found from there, with its own time.
            if found is not None and len(found[1]) == end - start:
                yield 1e-6 * int.from_bytes(log[at:start], "big"), found[0]
                at = end
            elif found is None and self._follows(start, end):
                at = end
            else:
                self.skipped += 1
                at += 1
        self.skipped += len(log) - at

    def _size(self, start: int) -> int:
        """Bytes of the frame that begins at ``start``; 0: none does, or it is cut."""
        log, size = self._log, 0
        if log[start] == _MAGIC_2:
            size = 12 + log[start + 1] + _SIGNATURE * (log[start + 2] & 1)
        elif log[start] == _MAGIC_1:
            size = 8 + log[start + 1]
        return size if start + size <= len(log) else 0

    def _follows(self, start: int, end: int) -> bool:
        """Whether a frame that cannot be checked ends where another one, or nothing, begins."""
        after = end + _STAMP
        return end > start and (
            end == len(self._log) or (after < len(self._log) and self._log[after] in _MAGICS)
        )


def tlog_frames(log: bytes) -> Iterator[tuple[float, Frame]]:
    """Every frame of a log with its time [s]."""
    return iter(TlogFrames(log))
