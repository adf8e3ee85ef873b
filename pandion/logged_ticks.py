"""A flight log tick by tick: what went in, and the records of what came out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from fsw.autopilot.measurements import ImuSample, Sample
from fsw.autopilot.signals import SensorFrame, TickInputs, frame_of_samples
from fsw.log import topics
from fsw.log.encoder import SAMPLES, TYPED
from fsw.log.json_codec import JsonCodec
from fsw.log.packed import TOPIC_NUMBERS, Samples
from messages import ulog
from messages.ulog_reader import Record, UlogError, UlogFile, open_log, unpacker

_SENSORS: Final = topics.NUMBERS["sensor_frame"]
_INPUT: Final = topics.NUMBERS["tick_input"]
_TICK: Final = topics.NUMBERS["tick"]
_OF_THE_LOOP: Final = frozenset({topics.NUMBERS["loop_timing"], topics.NUMBERS["cpuload"]})


@dataclass(frozen=True, slots=True)
class LoggedTick:
    """One tick."""

    index: int  # counted from 0 in this log
    inputs: TickInputs
    records: list[Record]  # everything the encoder wrote for it


@dataclass(frozen=True, slots=True)
class Gap:
    """Here the disk was too slow, and ticks are missing."""

    index: int  # of the tick that comes after it
    duration_ms: int


def open_flight(path: Path) -> UlogFile:
    """Open a flight log, by its file or its directory, whose inputs this build can read.

    Raises:
        UlogError: It is no flight log, or its inputs have another shape.
    """
    log = open_log(path / "flight.ulg" if path.is_dir() else path)
    if "inputs" not in log.information:
        raise UlogError(f"{log.path} is not a flight log of Pandion: it records no inputs")
    if log.information["inputs"] != JsonCodec(TickInputs).schema or not _has_our_topics(log):
        written = log.information.get("ver_sw", "an unknown revision")
        raise UlogError(f"{log.path} has other fields than this build reads; it is of {written}")
    return log


def _has_our_topics(log: UlogFile) -> bool:
    try:
        rotors, joints = counts(log)
        ours = [topic.sized(rotor=rotors, joint=joints) for topic in topics.TOPICS]
        return all(log.formats[topic.name].codes == topic.codes for topic in ours)
    except (KeyError, ValueError):  # a topic is missing, or has an unknown type
        return False


def counts(log: UlogFile) -> tuple[int, int]:
    """How many rotors and joints the vehicle of a log has.

    Raises:
        KeyError: The log does not say.
    """
    sizes = {one.name: one.count for one in log.formats["actuator_command"].fields}
    return sizes["rotor_thrust"], sizes["joint_torque"]


def ticks(log: UlogFile) -> Iterator[LoggedTick | Gap]:
    """Every whole tick of a log, and where some are missing.

    The last tick is whole if the mark behind a block follows it. Without the mark the log was cut,
    perhaps inside that tick: it is left out, and ``log.whole`` becomes False.

    Raises:
        UlogError: An input cannot be read back, or the log holds no whole tick.
    """
    inputs, index, records, lost_ms, ended = _Inputs(log), 0, list[Record](), 0, False
    for record in log.records():
        if record.kind == ulog.DROPOUT:
            lost_ms += int.from_bytes(record.body, "little")
        elif record.kind == ulog.SYNC:
            ended = True
        elif _of_a_tick(record):
            if record.number in (_SENSORS, _TICK) and records:
                yield inputs.tick(index, records)
                index, records = index + 1, []
                if lost_ms:
                    yield Gap(index, lost_ms)
                    lost_ms = 0
            records.append(record)
            ended = False
    if records and ended:
        yield inputs.tick(index, records)
        return
    log.whole = False
    if index == 0:
        raise UlogError(f"{log.path} holds no whole tick")


def not_of_ticks(log: UlogFile) -> list[str]:
    """What a log that was read holds that no tick makes, and so no replay."""
    found = [
        topic.name
        for number, topic in log.topics.items()
        if number >= len(topics.TOPICS) or number in _OF_THE_LOOP
    ]
    found += ["tagged texts"] if ulog.TAGGED in log.kinds else []
    foreign = log.kinds & {ulog.MULTI_INFO, ulog.DEFAULT_PARAMETER, ulog.REMOVAL}
    return found + [f"messages of kind {kind.decode()}" for kind in sorted(foreign)]


def _of_a_tick(record: Record) -> bool:
    """Whether the encoder writes it: timing is the loop's, truth the simulator's."""
    if record.kind == ulog.DATA:
        return record.number < len(topics.TOPICS) and record.number not in _OF_THE_LOOP
    return record.kind == ulog.TEXT


class _Inputs:
    """Puts the inputs of each tick together; what did not change is what it was."""

    def __init__(self, log: UlogFile) -> None:
        self._log = log
        self._codec = JsonCodec(TickInputs)
        self._values: dict[str, Any] = {}
        self._pieces = b""
        self._imu: ImuSample | None = None  # the last one
        joints = counts(log)[1]
        self._samples, self._joints = Samples(joints), joints
        self._sensors = unpacker(topics.BY_NAME["sensor_frame"].sized(joint=joints))
        self._input = unpacker(topics.BY_NAME["tick_input"])

    def tick(self, index: int, records: list[Record]) -> LoggedTick:
        if index == 0:
            self._check_numbers()
        measured: list[Sample] = []
        short_us: int | None = None
        try:
            for record in records:
                if record.kind != ulog.DATA:
                    continue
                if record.number in TOPIC_NUMBERS:
                    measured.append(self._samples.sample_of(record.number, record.body))
                elif record.number == _SENSORS:
                    self._values[TYPED] = _sensor_frame(
                        self._sensors.unpack(record.body), self._joints
                    )
                elif record.number == _TICK:
                    short_us = int.from_bytes(record.body, "little")
                elif record.number == _INPUT:
                    self._take(record.body)
            self._values[SAMPLES] = tuple(measured)
            self._imu = next(
                (one for one in reversed(measured) if isinstance(one, ImuSample)), self._imu
            )
            if short_us is not None:
                self._values[TYPED] = self._of_samples(short_us)
            return LoggedTick(index, TickInputs(**self._values), records)
        except (ValueError, TypeError) as error:
            raise UlogError(f"{self._log.path} is damaged in tick {index}: {error}") from None

    def _of_samples(self, t_us: int) -> SensorFrame:
        """The frame of a tick that says nothing but what the inertial unit measured last."""
        if self._imu is None:
            raise ValueError("it repeats what an inertial unit says, and none was heard")
        return frame_of_samples(t_us, (self._imu,), self._joints)

    def _check_numbers(self) -> None:
        for number, topic in enumerate(topics.TOPICS):
            known = self._log.topics.get(number)
            if known is None or known.name != topic.name:
                raise UlogError(f"{self._log.path} is damaged: topic {number} is another")

    def _take(self, body: bytes) -> None:
        _, field, part, parts, text = self._input.unpack(body)
        self._pieces = (self._pieces if part else b"") + text
        if part + 1 < parts:
            return
        name = field.rstrip(b"\0").decode("ascii", "backslashreplace")
        self._values[name] = self._codec.decode(name, self._pieces.rstrip(b"\0"))


def _sensor_frame(values: tuple[Any, ...], joints: int) -> SensorFrame:
    return SensorFrame(
        t_us=values[0],
        p_WB=values[1:4],
        v_WB=values[4:7],
        q_WB=values[7:11],
        gyro_B=values[11:14],
        accel_B=values[14:17],
        q_arm=values[17 : 17 + joints],
        qd_arm=values[17 + joints :],
    )
