"""Samples of sensors as records of the flight log, and back, exactly."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from struct import Struct
from typing import Any, Final

from fsw.autopilot.measurements import ImuSample, Sample
from fsw.autopilot.signals import SensorFrame
from fsw.log import topics
from messages.ulog import Topic, data_head
from messages.ulog_reader import unpacker

Values = tuple[Any, ...]
_NO_VECTOR: Final = (math.nan, math.nan, math.nan)
_LATEST: Final = 1e12  # s; what is later fits no field


def _sampled_us(one: Sample) -> int:
    """When it was measured [us]; 0 before the clock began or where that is not known."""
    return round(1e6 * one.time) if 0.0 <= one.time < _LATEST else 0


def _flattener(names: Sequence[str], sizes: Sequence[int]) -> Callable[[Sample], Values]:
    """What takes a sample's fields apart, those that have a size into their numbers."""
    fields = zip(names, sizes, strict=True)
    parts = [f"*one.{name}" if size else f"one.{name}" for name, size in fields]
    made: Callable[[Sample], Values] = eval(f"lambda one: ({', '.join(parts)},)")
    return made


class _Codec:
    """Records of one kind of sample."""

    def __init__(self, kind: type[Sample], topic: Topic) -> None:
        self.number = topics.NUMBERS[topic.name]
        self._kind = kind
        own = [field for field in topic.fields if field.name != topics.SAMPLED]
        self._sizes = tuple(field.count for field in own)  # 0: a number by itself
        names = [field.name for field in dataclasses.fields(kind)]
        self._values = _flattener(names, self._sizes)
        self._is_stamped = len(own) < len(topic.fields)
        self.head = data_head(self.number, topic)
        self.pack = Struct("<5s" + topic.codes).pack
        self._unpack: Callable[[bytes], Values] = unpacker(topic).unpack

    def values(self, sample: Sample) -> Values:
        """As the record has them."""
        values = self._values(sample)
        return (*values, _sampled_us(sample)) if self._is_stamped else values

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
        self._arm = (math.nan,) * joints
        self._codecs = {
            kind: _Codec(kind, topic.sized(joint=joints))
            for kind, topic in topics.OF_SAMPLES.items()
        }
        self._by_number = {codec.number: codec for codec in self._codecs.values()}

    def frame_of(self, t_us: int, imu: ImuSample) -> SensorFrame:
        """The frame of a tick of which nothing is known but what the inertial unit measured.

        Like the link's: what is not known is ``math.nan`` itself, so that such frames are equal.
        """
        attitude = (*_NO_VECTOR, math.nan)
        known = imu.rate, imu.acceleration
        return SensorFrame(t_us, _NO_VECTOR, _NO_VECTOR, attitude, *known, self._arm, self._arm)

    def record(self, t_us: int, sample: Sample) -> bytes:
        """The record of a sample that arrived for the tick of ``t_us``."""
        codec = self._codecs[type(sample)]
        return codec.pack(codec.head, t_us, *codec.values(sample))

    def sample_of(self, number: int, body: bytes) -> Sample:
        """The sample in the body of a record of topic ``number``, one of ``TOPIC_NUMBERS``."""
        return self._by_number[number].read(body)
