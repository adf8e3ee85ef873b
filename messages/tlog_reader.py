"""Reading a telemetry log (``.tlog``): a time and a MAVLink frame, again and again.

Source: what QGroundControl and MAVProxy write, and ``fsw/log/tlog.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from messages.frames import Frame, split

_STAMP: Final = 8  # bytes before each frame: microseconds, big-endian
_SIGNATURE: Final = 13


def tlog_frames(log: bytes) -> Iterator[tuple[float, Frame]]:
    """Every frame with its time [s]; ends at the first byte that begins no frame."""
    at = 0
    while at + _STAMP + 3 <= len(log):
        start = at + _STAMP
        if log[start] == 0xFD:
            size = 12 + log[start + 1] + _SIGNATURE * (log[start + 2] & 1)
        elif log[start] == 0xFE:
            size = 8 + log[start + 1]
        else:
            return
        stamp = 1e-6 * int.from_bytes(log[at:start], "big")
        for frame in split(log[start : start + size]):
            yield stamp, frame
        at = start + size
