"""Records of topics as bytes: several in one call, those of samples and back, those with a rate."""

from __future__ import annotations

import dataclasses
import math
import struct
from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from struct import Struct
from typing import Any, Final

from fsw.autopilot.measurements import Sample
from fsw.autopilot.signals import FlightSnapshot
from fsw.log import topics
from messages.ulog import Topic, data_head
from messages.ulog_reader import unpacker

_LARGEST: Final = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]


Values = tuple[Any, ...]
_LATEST: Final = 1e12  # s; what is later fits no field


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


class _Codec:
    """Records of one kind of sample."""

    def __init__(self, kind: type[Sample], topic: Topic) -> None:
        self.number = topics.NUMBERS[topic.name]
        self._kind = kind
        self._of = attrgetter(*[field.name for field in dataclasses.fields(kind)])
        own = [field for field in topic.fields if field.name != topics.SAMPLED]
        self._sizes = tuple(field.count for field in own)  # 0: a number by itself
        self._is_stamped = len(own) < len(topic.fields)
        self.head = data_head(self.number, topic)
        self.pack = Struct("<5s" + topic.codes).pack
        self._unpack: Callable[[bytes], Values] = unpacker(topic).unpack

    def values(self, sample: Sample) -> list[float]:
        """As the record has them."""
        values: list[float] = []
        for value, size in zip(self._of(sample), self._sizes, strict=True):
            if size:
                values += value
            else:
                values.append(value)
        if self._is_stamped:
            # In whole microseconds; 0 before the clock began or where that is not known.
            time = sample.time
            values.append(round(1e6 * time) if 0.0 <= time < _LATEST else 0)
        return values

    def read(self, body: bytes) -> Sample:
        """The sample again."""
        return self._kind(*self._grouped(self._unpack(body)[1:]))

    def _grouped(self, values: Values) -> Iterator[Any]:
        at = 0
        for size in self._sizes:
            yield values[at : at + size] if size else values[at]
            at += max(size, 1)


TOPIC_NUMBERS: Final = frozenset(topics.NUMBERS[one.name] for one in topics.OF_SAMPLES.values())


class Samples:
    """Samples of a vehicle with so many joints as records, and back, exactly."""

    def __init__(self, joints: int) -> None:
        self._codecs = {
            kind: _Codec(kind, topic.sized(joint=joints))
            for kind, topic in topics.OF_SAMPLES.items()
        }
        self._by_number = {codec.number: codec for codec in self._codecs.values()}

    def record(self, t_us: int, sample: Sample) -> bytes:
        """The record of a sample that arrived for the tick of ``t_us``."""
        codec = self._codecs[type(sample)]
        return codec.pack(codec.head, t_us, *codec.values(sample))

    def sample_of(self, number: int, body: bytes) -> Sample:
        """The sample in the body of a record of topic ``number``, one of ``TOPIC_NUMBERS``."""
        return self._by_number[number].read(body)


class Timetable:
    """Records that have a rate each: one for the first tick in each of its intervals."""

    def __init__(self, *rows: tuple[int, Callable[[FlightSnapshot], bytes]]) -> None:
        """Take the interval [us] of each, and what makes it."""
        self._rows = rows
        self._looked_us = self._until_us = -1  # last, and until when nothing more is due

    def due(self, t_us: int, snapshot: FlightSnapshot) -> bytes:
        """Those that are due at ``t_us``, of a ``snapshot``, in their order."""
        last_us = self._looked_us
        if last_us <= t_us < self._until_us:
            return b""
        found = [
            record(snapshot)
            for period_us, record in self._rows
            if t_us // period_us != last_us // period_us
        ]
        self._looked_us = t_us
        self._until_us = min((t_us // period_us + 1) * period_us for period_us, _ in self._rows)
        return b"".join(found)


def _within_float(value: Any) -> Any:
    """The value, or infinity where a 32-bit float has no room for it."""
    if isinstance(value, float) and _LARGEST < abs(value) < math.inf:
        return math.copysign(math.inf, value)
    return value
