"""Samples of sensors as records of the flight log, and back, exactly."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from operator import attrgetter
from struct import Struct
from typing import Any, Final

from fsw.autopilot.measurements import Sample
from fsw.log import topics
from messages.ulog import Topic, data_head
from messages.ulog_reader import unpacker

Values = tuple[Any, ...]
_LATEST: Final = 1e12  # s; what is later fits no field


def _sampled_us(one: Sample) -> int:
    """When it was measured [us]; 0 before the clock began or where that is not known."""
    return round(1e6 * one.time) if 0.0 <= one.time < _LATEST else 0


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

    def values(self, sample: Sample) -> Values:
        """As the record has them."""
        values: list[float] = []
        for value, size in zip(self._of(sample), self._sizes, strict=True):
            if size:
                values += value
            else:
                values.append(value)
        if self._is_stamped:
            values.append(_sampled_us(sample))
        return tuple(values)

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
    """Records of a vehicle with so many joints."""

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
