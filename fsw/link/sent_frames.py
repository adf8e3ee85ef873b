"""Frames that the vehicle has sent, known again where a router sends them back.

The bytes decide, not who a frame says it is from: a companion computer may have any identity, and
that of the vehicle's system is usual (mavros is 1/191, the MAVSDK of a companion 1/195).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

# Half of what is remembered. A link sends 1500 messages a second at most, and usually 200: a frame
# that a router holds back for five seconds is still known.
_HALF: Final = 8192


class SentFrames:
    """Shared by all links: a router may send what one of them has sent to another one."""

    def __init__(self) -> None:
        """Nothing has been sent."""
        self._newer: set[int] = set()
        self._older: set[int] = set()

    def add(self, frames: Iterable[bytes]) -> None:
        """Remember whole frames; of those longest ago half are forgotten at once."""
        self._newer.update(map(hash, frames))
        if len(self._newer) > _HALF:
            self._older, self._newer = self._newer, set()

    def __contains__(self, frame: bytes) -> bool:
        return hash(frame) in self._newer or hash(frame) in self._older
