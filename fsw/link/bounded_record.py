"""What is recorded of a link is bounded: nobody fills the disk with what they send or ask for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

RecordFrame = Callable[[int, bytes], None]
"""Takes the sensor time [us] and one frame, for the log."""

# Some six times what a ground station and all telemetry at its highest rates need.
BYTES_PER_S: Final = 128_000


class BoundedRecord:
    """Records the frames of one direction, and counts those for which a second has no room."""

    def __init__(self, record: RecordFrame | None) -> None:
        """Without ``record`` nothing is recorded, and nothing is missing."""
        self.left_out = 0  # frames
        self._record = record
        self._room = float(BYTES_PER_S)  # bytes
        self._t_us = 0

    def add(self, t_us: int, frame: bytes) -> None:
        """Record a frame at a sensor time [us], if there is room."""
        if self._record is None:
            return
        passed_s = 1e-6 * max(t_us - self._t_us, 0)
        self._room = min(self._room + BYTES_PER_S * passed_s, BYTES_PER_S)
        self._t_us = t_us
        if len(frame) > self._room:
            self.left_out += 1
            return
        self._room -= len(frame)
        self._record(t_us, frame)
