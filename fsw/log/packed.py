"""Records of topics as bytes, several in one call."""

from __future__ import annotations

import math
import struct
from struct import Struct
from typing import Any, Final

from fsw.log import topics
from messages.ulog import Topic, data_head

_LARGEST: Final = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]


class Records:
    """Records that are packed in one call."""

    def __init__(self, layout: str) -> None:
        """As :mod:`struct` names them."""
        self.struct = Struct(layout)

    def pack(self, values: tuple[Any, ...]) -> bytes:
        """Pack heads and values; a number too large for a float becomes infinite."""
        try:
            return self.struct.pack(*values)
        except OverflowError:
            return self.struct.pack(*map(_within_float, values))


class Packed(Records):
    """Records of some topics."""

    def __init__(self, *members: Topic) -> None:
        super().__init__("<" + "".join("5s" + topic.codes for topic in members))
        self.heads = tuple(data_head(topics.NUMBERS[topic.name], topic) for topic in members)


def _within_float(value: Any) -> Any:
    """The value, or infinity where a 32-bit float has no room for it."""
    if isinstance(value, float) and _LARGEST < abs(value) < math.inf:
        return math.copysign(math.inf, value)
    return value
