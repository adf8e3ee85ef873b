"""What a link remembers and records is bounded: nobody fills memory or disk with what they send."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, TypeVar

K = TypeVar("K")
V = TypeVar("V")
RecordFrame = Callable[[int, bytes], None]
"""Takes the sensor time [us] and one frame, for the log."""

# Some six times what a ground station and all telemetry at its highest rates need.
BYTES_PER_S: Final = 128_000
# Half of what is remembered. A link sends 1500 messages a second at most, and usually 200: a frame
# that a router holds back for five seconds is still known.
_HALF: Final = 8192


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


class SentFrames:
    """Frames that the vehicle has sent, known again where a router sends them back on any link.

    The bytes decide, not who a frame says it is from: a companion computer may have any identity,
    and that of the vehicle's system is usual (mavros is 1/191, the MAVSDK of a companion 1/195).
    """

    def __init__(self) -> None:
        self._newer: set[int] = set()
        self._older: set[int] = set()

    def add(self, frames: Iterable[bytes]) -> None:
        """Remember whole frames; of those longest ago half are forgotten at once."""
        self._newer.update(map(hash, frames))
        if len(self._newer) > _HALF:
            self._older, self._newer = self._newer, set()

    def __contains__(self, frame: bytes) -> bool:
        return hash(frame) in self._newer or hash(frame) in self._older


def renew(kept: dict[K, V], key: K, value: V, most: int) -> None:
    """Put a value in as the newest, and forget the oldest where there are more than ``most``."""
    kept.pop(key, None)
    kept[key] = value
    if len(kept) > most:
        del kept[next(iter(kept))]
