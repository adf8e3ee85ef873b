"""Samples of sensors as records of the flight log, and back, exactly."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from struct import Struct, pack
from typing import Any, Final

from fsw.autopilot.measurements import ImuSample, JointSample, PoseSample, Sample
from fsw.log import topics
from messages.ulog import Topic, data_head
from messages.ulog_reader import unpacker

Values = tuple[Any, ...]
_SIX: Final = Struct("<6d")
_UNKNOWN_POSE: Final = pack("<10d", *(math.nan,) * 10)  # position, velocity and attitude
_LATEST: Final = 1e12  # s; what is later fits no field


def _of_imu(one: ImuSample) -> Values:
    return (one.time, *one.acceleration, *one.rate)


def _of_joints(one: JointSample) -> Values:
    return (one.time, *one.angles)


def _of_pose(one: PoseSample) -> Values:
    place = (one.time, *one.position, *one.attitude, *one.position_variance)
    return (*place, *one.attitude_variance, one.reset_counter, one.drifts, _sampled_us(one))


# The frequent ones; :class:`_Codec` finds the values of any other by the names of its fields.
_VALUES: Final[dict[type, Callable[[Any], Values]]] = {
    ImuSample: _of_imu,
    JointSample: _of_joints,
    PoseSample: _of_pose,
}


def _sampled_us(one: Sample) -> int:
    """When it was measured [us]; 0 before the clock began or where that is not known."""
    return round(1e6 * one.time) if 0.0 <= one.time < _LATEST else 0


class _Codec:
    """Records of one kind of sample."""

    def __init__(self, kind: type[Sample], topic: Topic) -> None:
        self.number = topics.NUMBERS[topic.name]
        self._kind = kind
        self._names = tuple(field.name for field in dataclasses.fields(kind))
        own = [field for field in topic.fields if field.name != topics.SAMPLED]
        self._sizes = tuple(field.count for field in own)  # 0: a number by itself
        self.head = data_head(self.number, topic)
        self.pack = Struct("<5s" + topic.codes).pack
        self.values = _VALUES.get(kind, self._any_values)
        self._unpack: Callable[[bytes], Values] = unpacker(topic).unpack

    def _any_values(self, sample: Sample) -> Values:
        values: list[float] = []
        for name, size in zip(self._names, self._sizes, strict=True):
            value = getattr(sample, name)
            if size:
                values += value
            else:
                values.append(value)
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
        frame = topics.SENSOR_FRAME.sized(joint=joints)
        self.frame = Struct("<" + "".join(field.code for field in frame.fields))
        self._unknown_arm = pack(f"<{2 * joints}d", *(math.nan,) * (2 * joints))
        self._codecs = {
            kind: _Codec(kind, topic.sized(joint=joints))
            for kind, topic in topics.OF_SAMPLES.items()
        }
        self._by_number = {codec.number: codec for codec in self._codecs.values()}

    def frame_of(self, imu: ImuSample) -> bytes:
        """The numbers of a frame of sensors of which the inertial unit alone is known."""
        return _UNKNOWN_POSE + _SIX.pack(*imu.rate, *imu.acceleration) + self._unknown_arm

    def record(self, t_us: int, sample: Sample) -> bytes:
        """The record of a sample that arrived for the tick of ``t_us``."""
        codec = self._codecs[type(sample)]
        return codec.pack(codec.head, t_us, *codec.values(sample))

    def sample_of(self, number: int, body: bytes) -> Sample:
        """The sample in the body of a record of topic ``number``, one of ``TOPIC_NUMBERS``."""
        return self._by_number[number].read(body)
