"""A flight's log as arrays, for whatever draws it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.signals import TickInputs
from fsw.log.json_codec import JsonCodec
from fsw.log.topics import TOPICS
from messages import ulog
from messages.ground_truth import TRUTH_TOPICS
from messages.ulog import Field, Topic
from messages.ulog_reader import UlogError, UlogFile, open_log
from view.results_beside import results_beside

__all__ = ["FlightData", "InputChange", "Table", "Text", "UlogError", "read_flight"]

Array = NDArray[Any]

_NUMPY: Final = {
    "uint8_t": "u1", "int8_t": "i1", "uint16_t": "<u2", "int16_t": "<i2", "uint32_t": "<u4",
    "int32_t": "<i4", "uint64_t": "<u8", "int64_t": "<i8", "float": "<f4", "double": "<f8",
    "bool": "?",
}  # fmt: skip
_INPUTS: Final = "tick_input"
_OURS: Final = {
    topic.name: {one.name: one for one in topic.fields} for topic in (*TOPICS, *TRUTH_TOPICS)
}
_VECTOR: Final = 4  # elements of an array that is a vector or a quaternion, at most


class Text(NamedTuple):
    """A sentence in the log."""

    t: float  # s, sensor time
    severity: int  # MAV_SEVERITY: 0 the worst
    text: str


class InputChange(NamedTuple):
    """An input of the tick that took another value."""

    t: float  # s, sensor time
    name: str  # of the field of TickInputs
    json: bytes


class Row(dict[str, Any]):
    """One record: its fields by name; the value of an array is an array."""

    topic = ""

    def __missing__(self, name: str) -> Any:
        raise _missing(self.topic, name)


@dataclass(frozen=True, slots=True)
class Table:
    """All records of one topic: ``t`` (n,) [s, sensor time] and a column of each field."""

    name: str
    t: NDArray[np.float64]
    columns: Mapping[str, Array]  # (n,), of an array (n, elements), of a text (n,) bytes

    def __getitem__(self, name: str) -> Array:
        """A column.

        Raises:
            UlogError: The log is of a build whose topic has no such field.
        """
        try:
            return self.columns[name]
        except KeyError:
            raise _missing(self.name, name) from None

    def __len__(self) -> int:
        return len(self.t)

    def row(self, place: int) -> Row:
        """One record."""
        found = Row({name: values[place] for name, values in self.columns.items()})
        found.topic = self.name
        return found


@dataclass(frozen=True, slots=True)
class FlightData:
    """A log, read whole."""

    path: Path
    information: Mapping[str, str | int]
    parameters: Mapping[str, float]
    tables: Mapping[str, Table]  # of topics with records, by name
    texts: tuple[Text, ...]
    inputs: tuple[InputChange, ...]  # see :meth:`decoded`
    lost_ms: int  # of data, where the disk was too slow
    cut: str  # what is missing at its end, behind "the log"; empty: nothing
    beside: Mapping[str, Any] = field(default_factory=dict)
    """``result.json``, ``sitl.json`` and ``fsw.json`` beside it, by stem, where there are."""
    unusable: tuple[str, ...] = ()  # a sentence about each of these that cannot be used

    @property
    def begin(self) -> float:
        """Of the first record [s, sensor time]."""
        return min((float(table.t[0]) for table in self.tables.values()), default=0.0)

    @property
    def end(self) -> float:
        """Of the last record [s, sensor time]."""
        return max((float(table.t[-1]) for table in self.tables.values()), default=0.0)

    def decoded(self, name: str) -> list[tuple[float, Any]]:
        """Every value of one input with the time [s] at which it came, from ``autopilot.signals``.

        Raises:
            UlogError: The log is of a build with other inputs.
        """
        codec = _codec()
        try:
            return [
                (one.t, codec.decode(name, one.json)) for one in self.inputs if one.name == name
            ]
        except ValueError as problem:
            raise UlogError(f"{self.path}: {problem}") from None


def read_flight(path: Path) -> FlightData:
    """Read a flight log, by its file or its directory; topics of any build.

    Raises:
        UlogError: It is no log, one of another system, is damaged, or holds no record.
    """
    log = open_log(path / "flight.ulg" if path.is_dir() else path)
    if not log.is_ours:
        raise UlogError(
            f"{log.path} is a log of {log.system[:32]!r}, whose vehicle has "
            "no arm to show; `pandion export` writes it as CSV or MCAP"
        )
    bodies: dict[str, list[bytes]] = {}  # by topic: one may have had several numbers
    topics: dict[str, Topic] = {}
    texts: list[Text] = []
    lost_ms = 0
    for kind, number, body in log.records():
        if kind == ulog.DATA:
            topic = log.topics[number]
            if (of_topic := bodies.get(topic.name)) is None:
                topics[topic.name], bodies[topic.name] = topic, (of_topic := [])
            of_topic.append(body)
        elif (reported := ulog.text_of(kind, body)) is not None:
            severity, t_us, text = reported
            texts.append(Text(1e-6 * t_us, severity, text))
        elif kind == ulog.DROPOUT:
            lost_ms += int.from_bytes(body, "little")
    tables = {name: _table(log, topics[name], b) for name, b in bodies.items()}
    if not tables:
        raise UlogError(f"{log.path} holds no record")
    inputs = _inputs(tables.pop(_INPUTS)) if _INPUTS in tables else ()
    texts.sort(key=lambda one: one.t)
    beside, unusable = results_beside(log.path)
    return FlightData(
        path=log.path,
        information=log.information,
        parameters=log.parameters,
        tables=tables,
        texts=tuple(texts),
        inputs=inputs,
        lost_ms=lost_ms,
        cut=log.cut,
        beside=beside,
        unusable=unusable,
    )


@cache
def _codec() -> JsonCodec:
    return JsonCodec(TickInputs)


def _missing(topic: str, name: str) -> UlogError:
    return UlogError(f"the log is of another build: its topic {topic} has no {name}")


def _table(log: UlogFile, topic: Topic, bodies: list[bytes]) -> Table:
    _check_fields(log, topic)
    records = np.frombuffer(b"".join(bodies), dtype=_dtype(topic))
    columns = {one.name: records[one.name] for one in topic.fields if not one.is_padding}
    t = 1e-6 * records["timestamp"].astype(np.float64)
    if np.any(np.diff(t) < 0.0):  # the simulator's records were appended; others are in order
        order = np.argsort(t, kind="stable")
        t, columns = t[order], {name: column[order] for name, column in columns.items()}
    return Table(topic.name, t, columns)


def _check_fields(log: UlogFile, topic: Topic) -> None:
    """Refuse a topic of ours with a field of another shape; one may be missing, or be new.

    Raises:
        UlogError: A field is there twice, or is of another kind than in this build.
    """
    fields = {one.name: one for one in topic.all_fields}
    if len(fields) != len(topic.all_fields):
        raise UlogError(f"{log.path} is damaged: a field of topic {topic.name} is there twice")
    for name, ours in _OURS.get(topic.name, {}).items():
        if name in fields and not _is_like(fields[name], ours):
            raise UlogError(
                f"{log.path} is of another build: {name} of topic {topic.name} is "
                f"{fields[name].declared.removesuffix(name).strip()} there and "
                f"{ours.declared.removesuffix(name).strip()} here"
            )


def _is_like(one: Field, ours: Field) -> bool:
    """Whether a field is a number or text as ours; an array of more than a few may have grown."""
    if _kind(one) != _kind(ours):
        return False
    longer = min(one.count, ours.count) > _VECTOR or ours.type == "char" or bool(ours.per)
    return longer or one.count == ours.count


def _kind(one: Field) -> str:
    if one.type in ("float", "double"):
        return "real"
    return one.type if one.type in ("char", "bool") else "whole"


def _dtype(topic: Topic) -> np.dtype[Any]:
    fields: list[Any] = []
    for one in topic.all_fields:
        if one.is_padding:
            fields.append((one.name, f"V{one.code.removesuffix('x')}"))
        elif one.type == "char":
            fields.append((one.name, f"S{one.count or 1}"))
        else:
            fields.append((one.name, _NUMPY[one.type], (one.count,) if one.count else ()))
    return np.dtype(fields)


def _inputs(table: Table) -> tuple[InputChange, ...]:
    """Put long texts together again."""
    changes, pieces = [], b""
    parts = zip(table.t, table["field"], table["part"], table["parts"], table["text"], strict=True)
    for t, name, part, of, text in parts:
        pieces = (pieces if part else b"") + text
        if part + 1 == of:
            changes.append(InputChange(float(t), name.decode("ascii", "replace"), pieces))
    return tuple(changes)
