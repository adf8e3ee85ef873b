"""Feeds a logged flight through the tick again and compares all that comes out.

The planner does not run: its answers are inputs of the tick, and as such in the log.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from command_line.bounded_json import JsonError, json_numbers
from fsw.autopilot.model.airframe import Airframe
from fsw.log.encoder import FULL, THIN, LogEncoder
from fsw.log.px4_records import origin_of
from fsw.log.topics import TOPICS
from fsw.runtime.program import FlightProgram, TickRunner
from messages import ulog
from messages.ulog_reader import Record, UlogError, UlogFile, columns, split, unpacker
from pandion.logged_ticks import Gap, LoggedTick, ticks

Progress = Callable[[int, int], None]
"""Takes bytes read and bytes in all."""

_PROGRESS_TICKS = 500


@dataclass(frozen=True, slots=True)
class Difference:
    """The first thing that came out otherwise."""

    tick: int  # counted from 0 in the log
    t_us: int
    field: str  # topic.field
    logged: int | float | str
    replayed: int | float | str


@dataclass(frozen=True, slots=True)
class Replayed:
    """What a replay found."""

    ticks: int  # that were compared
    difference: Difference | None
    lost_ms: int  # missing in the log behind these ticks; what follows cannot be fed

    @property
    def same(self) -> bool:
        """Whether all of the log was compared, and nothing was different."""
        return self.difference is None and not self.lost_ms


def replay(log: UlogFile, program: FlightProgram, progress: Progress) -> Replayed:
    """Compare a log with the outputs of a program for its inputs, up to the first difference.

    Raises:
        UlogError: The log is damaged.
    """
    measured, profile = fact(log, "pacing") != "lockstep", fact(log, "profile")
    if profile not in (str(THIN), str(FULL)):
        raise UlogError(f"{log.path} is damaged: its profile {profile!r} is neither 0 nor 1")
    facts = program.facts
    encoder = LogEncoder(
        measured=measured,
        airframe=facts.airframe,
        profile=int(profile),
        origin=origin_of(logged_numbers(log)),
    )
    tick = TickRunner(program.control, program.conclude, program.first_state, on_error=lambda: None)
    compared = 0
    for logged in ticks(log):
        if isinstance(logged, Gap):
            return Replayed(compared, None, logged.duration_ms)
        difference = _difference(logged, tick, encoder, facts.airframe)
        if difference is not None:
            return Replayed(compared, difference, 0)
        compared += 1
        if compared % _PROGRESS_TICKS == 0:
            progress(log.at, log.size)
    progress(log.size, log.size)
    return Replayed(compared, None, 0)


def fact(log: UlogFile, name: str) -> str:
    """An information of a log about its flight.

    Raises:
        UlogError: It is missing.
    """
    if name not in log.information:
        raise UlogError(f"{log.path} is damaged: its {name} is missing")
    return str(log.information[name])


def logged_numbers(log: UlogFile) -> dict[str, float]:
    """The configuration that was flown, by dotted name.

    Raises:
        UlogError: It cannot be read.
    """
    try:
        return json_numbers(fact(log, "numbers"))
    except JsonError as error:
        raise UlogError(f"{log.path} is damaged: its information numbers {error}") from None


def _difference(
    logged: LoggedTick, tick: TickRunner, encoder: LogEncoder, airframe: Airframe
) -> Difference | None:
    out = bytearray()
    try:
        encoder.add(logged.inputs, tick(logged.inputs), out)
    except Exception as error:  # of a tick that was flown, whatever its inputs look like
        raised = f"{type(error).__name__}: {error}"
        t_us = logged.inputs.sensors.t_us
        return Difference(
            tick=logged.index, t_us=t_us, field="the tick", logged="flown", replayed=raised
        )
    return _first_difference(logged, bytes(out), airframe.rotors, airframe.bodies.joints)


def _first_difference(
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
            return Difference(*where, "record", _record_name(one), _record_name(other))
        if one.kind == ulog.TEXT:
            return Difference(*where, "text", _text_of(one), _text_of(other))
        topic = TOPICS[one.number].sized(rotor=rotors, joint=joints)
        values = (map(_readable, unpacker(topic).unpack(record.body)) for record in (one, other))
        for name, was, now in zip(columns(topic), *values, strict=True):
            if repr(was) != repr(now):  # by their digits: NaN is NaN, and -0.0 is not 0.0
                return Difference(*where, f"{topic.name}.{name}", was, now)
    # All that both have is equal, so one of them goes on.
    at = min(len(logged.records), len(replayed))
    rest = [_record_name(records[at]) if at < len(records) else "nothing" for records in
            (logged.records, replayed)]  # fmt: skip
    return Difference(*where, "record", *rest)


def _record_name(record: Record) -> str:
    return TOPICS[record.number].name if record.kind == ulog.DATA else f"text {_text_of(record)!r}"


def _readable(value: int | float | bytes) -> int | float | str:
    """Characters and what is no number as text, as JSON wants them.

    The zeros that fill characters up say nothing.
    """
    if isinstance(value, bytes):
        return value.rstrip(b"\0").decode("utf-8", "backslashreplace")
    return value if math.isfinite(value) else repr(value)


def _text_of(record: Record) -> str:
    text = ulog.text_of(record.kind, record.body)
    return "" if text is None else text[2]


def other_numbers(log: UlogFile, program: FlightProgram) -> tuple[str, ...]:
    """Differences between the configuration of the program and the logged one."""
    logged = logged_numbers(log)
    here = program.numbers
    return tuple(
        f"{name} is {here.get(name, 'unknown')} here and was {logged.get(name, 'unknown')}"
        for name in sorted({*logged, *here})
        if logged.get(name) != here.get(name)
    )
