"""Records of topics as bytes, several in one call, and when they are due."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from struct import Struct
from typing import Any, Final

from fsw.log import topics
from messages.ulog import data_head

_LARGEST: Final = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]


class Packed:
    """Records of some topics of one instant."""

    def __init__(self, *names: str, **counts: int) -> None:
        """Take topics by their names, of a vehicle with so many of each ``rotor`` and ``joint``."""
        members = [topics.BY_NAME[name].sized(**counts) for name in names]
        self._struct = Struct("<" + "".join("5s" + topic.codes for topic in members))
        self._heads = tuple(data_head(topics.NUMBERS[topic.name], topic) for topic in members)

    def pack(self, t_us: int, *values: Sequence[Any]) -> bytes:
        """The records at ``t_us``, of the values of each; what no float can hold is infinite."""
        entries: list[Any] = []
        for head, of_topic in zip(self._heads, values, strict=True):
            entries += (head, t_us, *of_topic)
        try:
            return self._struct.pack(*entries)
        except OverflowError:
            return self._struct.pack(*map(_within_float, entries))


class Every:
    """A grid of instants, with one record for each interval."""

    def __init__(self, period_us: int) -> None:
        self._period_us, self._last = period_us, -1

    def is_due(self, t_us: int) -> bool:
        """Whether ``t_us`` is the first that was asked about in its interval."""
        last, self._last = self._last, t_us // self._period_us
        return self._last != last


def _within_float(value: Any) -> Any:
    """The value, or infinity where a 32-bit float has no room for it."""
    if isinstance(value, float) and _LARGEST < abs(value) < math.inf:
        return math.copysign(math.inf, value)
    return value
