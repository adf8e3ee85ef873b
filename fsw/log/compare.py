"""The first field in which two records of a tick differ."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.log.reader import LoggedTick
from fsw.log.topics import TOPICS
from messages import ulog
from messages.ulog_reader import Record, columns, split, unpacker


@dataclass(frozen=True, slots=True)
class Difference:
    """The first thing that came out otherwise."""

    tick: int  # counted from 0 in the log
    t_us: int
    field: str  # topic.field
    logged: int | float | str
    replayed: int | float | str


def first_difference(
    logged: LoggedTick, encoded: bytes, rotors: int, joints: int
) -> Difference | None:
    """Compare a logged tick with what the encoder made of the same tick now.

    Of a vehicle with so many ``rotors`` and ``joints``.
    """
    replayed = list(split(encoded))
    if replayed == logged.records:
        return None
    where = (logged.index, logged.inputs.sensors.t_us)
    for one, other in zip(logged.records, replayed, strict=False):
        if one == other:
            continue
        if (one.kind, one.number) != (other.kind, other.number):
            return Difference(*where, "record", _name(one), _name(other))
        if one.kind == ulog.TEXT:
            return Difference(*where, "text", _text(one), _text(other))
        topic = TOPICS[one.number].sized(rotor=rotors, joint=joints)
        values = (map(_readable, unpacker(topic).unpack(record.body)) for record in (one, other))
        for name, was, now in zip(columns(topic), *values, strict=True):
            if repr(was) != repr(now):  # by their digits: NaN is NaN, and -0.0 is not 0.0
                return Difference(*where, f"{topic.name}.{name}", was, now)
    # All that both have is equal, so one of them goes on.
    at = min(len(logged.records), len(replayed))
    rest = [_name(records[at]) if at < len(records) else "nothing" for records in
            (logged.records, replayed)]  # fmt: skip
    return Difference(*where, "record", *rest)


def _name(record: Record) -> str:
    return TOPICS[record.number].name if record.kind == ulog.DATA else f"text {_text(record)!r}"


def _readable(value: int | float | bytes) -> int | float | str:
    """Characters and what is no number as text, as JSON wants them.

    The zeros that fill characters up say nothing.
    """
    if isinstance(value, bytes):
        return value.rstrip(b"\0").decode("utf-8", "backslashreplace")
    return value if math.isfinite(value) else repr(value)


def _text(record: Record) -> str:
    text = ulog.text_of(record.kind, record.body)
    return "" if text is None else text[2]
