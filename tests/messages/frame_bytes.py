"""How a frame of ours may differ from pymavlink's."""

from __future__ import annotations

_MARKER = 0xFD


def as_pymavlink(ours: bytes, theirs: bytes) -> bool:
    """Whether they are the same; where theirs ends in a start marker, but for flag and checksum."""
    if theirs[-1] != _MARKER:
        return ours == theirs
    return ours[-1] != _MARKER and ours[:3] + ours[4:-2] == theirs[:3] + theirs[4:-2]
