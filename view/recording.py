"""A flight's files as arrays: the one reader for everything that draws or counts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from messages import ulog
from messages.ulog import Topic
from messages.ulog_reader import UlogError, UlogFile, open_log, unpacker

Columns = NDArray[Any]
"""Records of one topic: ``columns["name"]`` is (records,), or (records, n) for an array."""

_TYPES: Final = {
    "uint8_t": "u1", "int8_t": "i1", "uint16_t": "<u2", "int16_t": "<i2", "uint32_t": "<u4",
    "int32_t": "<i4", "uint64_t": "<u8", "int64_t": "<i8", "float": "<f4", "double": "<f8",
    "bool": "?",
}  # fmt: skip
_NONE: Final = np.empty(0, dtype=[("timestamp", "<u8")])


@dataclass(frozen=True, slots=True)
class LoggedText:
    """A status text."""

    t_s: float  # since the start
    severity: int  # MAV_SEVERITY
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Everything that a flight left behind."""

    path: Path  # of the log
    facts: dict[str, str | int]  # revision, scenario, seed, controller, …
    numbers: dict[str, float]  # of the whole configuration, by dotted name
    parameters: dict[str, float]  # of the vehicle, by name
    begin_us: int  # sensor time at the start: the zero of every time here
    topics: dict[str, Columns]  # those that have a record
    texts: tuple[LoggedText, ...]
    result: dict[str, Any] | None  # result.json, None where there is none
    sitl: dict[str, Any] | None  # sitl.json
    fsw: dict[str, Any] | None  # fsw.json
    lost_ms: int  # that the disk did not take
    whole: bool  # False for a log that was cut

    def topic(self, name: str) -> Columns:
        """Records of a topic; without any, an array of none that has a time stamp only."""
        return self.topics.get(name, _NONE)

    def seconds(self, name: str) -> NDArray[np.float64]:
        """Times of the records of a topic since the start [s], (records,)."""
        stamps = self.topic(name)["timestamp"].astype(np.int64)
        return 1e-6 * (stamps - self.begin_us)

    def inputs(self, field: str) -> list[tuple[float, Any]]:
        """Time since the start [s] and decoded value of an input of the tick, where it changed."""
        found, pieces = [], b""
        records = self.topic("tick_input")
        if not len(records):
            return []
        for record in records[records["field"] == field.encode()]:
            pieces = (pieces if record["part"] else b"") + bytes(record["text"])
            if record["part"] + 1 == record["parts"]:
                t_s = 1e-6 * (int(record["timestamp"]) - self.begin_us)
                found.append((t_s, json.loads(pieces.rstrip(b"\0"))))
        return found


def open_recording(path: Path) -> Recording:
    """Read a flight, by its directory or its log.

    Raises:
        UlogError: The file cannot be read, is no log of a flight, or is damaged.
    """
    log = open_log(path / "flight.ulg" if path.is_dir() else path)
    if log.information.get("sys_name") != "Pandion":
        raise UlogError(f"{log.path} is not a flight log of Pandion")
    bodies: dict[int, list[bytes]] = {}
    texts, lost_ms = [], 0
    for kind, number, body in log.records():
        if kind == ulog.DATA:
            bodies.setdefault(number, []).append(body)
        elif kind == ulog.DROPOUT:
            lost_ms += int.from_bytes(body, "little")
        elif (said := ulog.text_of(kind, body)) is not None:
            severity, t_us, text = said
            texts.append(LoggedText(1e-6 * (t_us - log.t_us), severity, text))
    if not bodies:
        raise UlogError(f"{log.path} holds no record")
    return Recording(
        path=log.path,
        facts=dict(log.information),
        numbers=_numbers(log),
        parameters=dict(log.parameters),
        begin_us=log.t_us,
        topics={log.topics[k].name: _columns(log.topics[k], part) for k, part in bodies.items()},
        texts=tuple(texts),
        result=_json(log.path.with_name("result.json")),
        sitl=_json(log.path.with_name("sitl.json")),
        fsw=_json(log.path.with_name("fsw.json")),
        lost_ms=lost_ms,
        whole=log.whole,
    )


def _columns(topic: Topic, bodies: Sequence[bytes]) -> Columns:
    layout: list[Any] = []
    for field in topic.all_fields:
        if field.type == "char":
            layout.append((field.name, f"S{field.count or 1}"))
        else:
            layout.append((field.name, _TYPES[field.type], *((field.count,) * (field.count > 0))))
    records = np.frombuffer(b"".join(bodies), dtype=np.dtype(layout))
    assert records.itemsize == unpacker(topic).size
    return records


def _numbers(log: UlogFile) -> dict[str, float]:
    try:
        found = json.loads(str(log.information.get("numbers", "{}")))
    except ValueError:
        raise UlogError(f"{log.path} is damaged: its numbers are no JSON") from None
    return {name: float(value) for name, value in found.items()}


def _json(path: Path) -> dict[str, Any] | None:
    """What a process wrote about the flight; None where it wrote nothing that can be read."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None
