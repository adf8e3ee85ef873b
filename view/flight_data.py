"""A flight's log as arrays, for whatever draws it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from command_line.bounded_file import read_bounded
from fsw.log.json_codec import JsonCodec
from fsw.signals import TickInputs
from messages import ulog
from messages.ulog import Topic
from messages.ulog_reader import UlogError, UlogFile, open_log

__all__ = ["FlightData", "InputChange", "Table", "Text", "UlogError", "read_flight"]

Array = NDArray[Any]

_NUMPY: Final = {
    "uint8_t": "u1", "int8_t": "i1", "uint16_t": "<u2", "int16_t": "<i2", "uint32_t": "<u4",
    "int32_t": "<i4", "uint64_t": "<u8", "int64_t": "<i8", "float": "<f4", "double": "<f8",
    "bool": "?",
}  # fmt: skip
_INPUTS: Final = "tick_input"
_MOST_BYTES: Final = 16 * 1024 * 1024  # of a result


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


@dataclass(frozen=True, slots=True)
class Table:
    """All records of one topic: ``t`` (n,) [s, sensor time] and a column of each field."""

    name: str
    t: NDArray[np.float64]
    columns: Mapping[str, Array]  # (n,), of an array (n, elements), of a text (n,) bytes

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.t)


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
    whole: bool  # False where the end is cut
    beside: Mapping[str, Any] = field(default_factory=dict)
    """``result.json``, ``sitl.json`` and ``fsw.json`` beside it, by stem, where there are."""

    @property
    def begin(self) -> float:
        """Of the first record [s, sensor time]."""
        return min((float(table.t[0]) for table in self.tables.values()), default=0.0)

    @property
    def end(self) -> float:
        """Of the last record [s, sensor time]."""
        return max((float(table.t[-1]) for table in self.tables.values()), default=0.0)

    def decoded(self, name: str) -> list[tuple[float, Any]]:
        """Every value of one input with the time [s] at which it came; values of ``fsw.signals``.

        Raises:
            UlogError: The log is of a build with other inputs.
        """
        codec = JsonCodec(TickInputs)
        try:
            return [
                (one.t, codec.decode(name, one.json)) for one in self.inputs if one.name == name
            ]
        except ValueError as problem:
            raise UlogError(f"{self.path}: {problem}") from None


def read_flight(path: Path) -> FlightData:
    """Read a flight log, by its file or its directory; topics of any build.

    Raises:
        UlogError: It is no log, is damaged, or holds no record.
    """
    log = open_log(path / "flight.ulg" if path.is_dir() else path)
    bodies: dict[int, list[bytes]] = {}
    texts: list[Text] = []
    lost_ms = 0
    for kind, number, body in log.records():
        if kind == ulog.DATA:
            if (of_topic := bodies.get(number)) is None:
                bodies[number] = of_topic = []
            of_topic.append(body)
        elif (reported := ulog.text_of(kind, body)) is not None:
            severity, t_us, text = reported
            texts.append(Text(1e-6 * t_us, severity, text))
        elif kind == ulog.DROPOUT:
            lost_ms += int.from_bytes(body, "little")
    tables = {log.topics[number].name: _table(log, number, b) for number, b in bodies.items()}
    if not tables:
        raise UlogError(f"{log.path} holds no record")
    inputs = _inputs(tables.pop(_INPUTS)) if _INPUTS in tables else ()
    texts.sort(key=lambda one: one.t)
    return FlightData(
        path=log.path,
        information=log.information,
        parameters=log.parameters,
        tables=tables,
        texts=tuple(texts),
        inputs=inputs,
        lost_ms=lost_ms,
        whole=log.whole,
        beside=_beside(log.path),
    )


def _table(log: UlogFile, number: int, bodies: list[bytes]) -> Table:
    topic = log.topics[number]
    records = np.frombuffer(b"".join(bodies), dtype=_dtype(topic))
    columns = {one.name: records[one.name] for one in topic.fields}
    t = 1e-6 * records["timestamp"].astype(np.float64)
    if np.any(np.diff(t) < 0.0):  # the simulator's records were appended; others are in order
        order = np.argsort(t, kind="stable")
        t, columns = t[order], {name: column[order] for name, column in columns.items()}
    return Table(topic.name, t, columns)


def _dtype(topic: Topic) -> np.dtype[Any]:
    fields: list[Any] = []
    for one in topic.all_fields:
        if one.type == "char":
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


def _beside(path: Path) -> dict[str, Any]:
    """What else the flight's directory says, as far as it can be read."""
    found = {}
    for stem in ("result", "sitl", "fsw"):
        try:
            read = json.loads(read_bounded(path.parent / f"{stem}.json", _MOST_BYTES))
        except (OSError, ValueError):
            continue
        if isinstance(read, dict):
            found[stem] = read
    return found
