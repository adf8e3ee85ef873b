"""What stands in a log around its ticks, beside what this build would have written there."""

from __future__ import annotations

from contextlib import suppress
from ctypes import c_float
from functools import partial
from typing import Final

from fsw.autopilot.parameters.control_choice import choice_of
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.autopilot.signals import TickInputs
from fsw.log.flight_log import LogSubject, formats, information, parameters, vehicle_facts
from fsw.log.json_codec import JsonCodec
from fsw.runtime.program import FlightProgram
from messages import ulog
from messages.ulog import Topic
from messages.ulog_reader import UlogFile
from pandion.flight_replay import Replayed, fact, logged_numbers
from pandion.logged_ticks import LoggedTick, not_of_ticks, open_flight, ticks
from vehicles.vehicle_file import parse_vehicle

_SHOWN: Final = 60  # characters of a value
_NAME: Final = "vehicle"  # information on which nothing else in a log depends


def compare_definitions(
    log: UlogFile, program: FlightProgram, found: Replayed
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What a replayed log says otherwise than its numbers, choice and ticks; what is not compared.

    Of the numbers themselves :func:`pandion.flight_replay.other_numbers` tells.

    Raises:
        UlogError: The log is damaged.
    """
    first = next(one for one in ticks(open_flight(log.path)) if isinstance(one, LoggedTick))
    begin_us, subject = first.inputs.sensors.t_us, _subject(log, program, first.inputs)
    facts = _information(log, subject, found)
    notes = [
        f"information {name} is {_short(here)} here and was {_short(log.information.get(name))}"
        for name, here in facts.items()
        if str(log.information.get(name)) != str(here)
    ]
    notes += _other_parameters(log, parameters(subject))
    notes += [
        f"the fields of {topic.name} are named otherwise here"
        for topic in formats(subject.airframe)
        if not _is_declared(log, topic)
    ]
    if log.t_us != begin_us:
        notes.append(f"the first tick was at {begin_us} us, and the log says {log.t_us} us")
    others = sorted({*log.information} - {*facts})
    return tuple(notes), (*others, *not_of_ticks(log))


def _subject(log: UlogFile, program: FlightProgram, first: TickInputs) -> LogSubject:
    """What the log must have been begun with, to have these numbers and inputs of its first tick.

    A vehicle's parameters that are not as configured are tuned by its first tick.
    """
    vehicle = parse_vehicle(fact(log, "vehicle_file"), fact(log, _NAME))
    numbers, values = logged_numbers(log), dict[str, float]()
    tuned = {**numbers, **dict(first.tuning or ())}
    for one in PARAMETERS:
        with suppress(KeyError, ValueError, OverflowError):  # of another build, or damaged
            values[one.name] = one.kept(tuned[one.path] / one.scale)
    return LogSubject(
        facts=choice_of(partial(fact, log)).facts() | vehicle_facts(vehicle),
        numbers=numbers,
        parameters=values,
        airframe=program.facts.airframe,
        profile=int(fact(log, "profile")),
    )


def _information(log: UlogFile, subject: LogSubject, found: Replayed) -> dict[str, str | int]:
    pacing = "lockstep" if fact(log, "pacing") == "lockstep" else "realtime"
    facts = information(subject, pacing, JsonCodec(TickInputs).schema)
    del facts[_NAME]
    if found.same and ulog.TICKS in log.information:
        facts[ulog.TICKS] = found.ticks
    return facts


def _other_parameters(log: UlogFile, here: dict[str, float]) -> list[str]:
    found = []
    for name in sorted({*here, *log.parameters}):
        ours, theirs = here.get(name), log.parameters.get(name)
        # The format's have 32 bits.
        if ours is None or theirs is None or theirs not in (ours, c_float(ours).value):
            found.append(f"parameter {name} is {_short(ours)} here and was {_short(theirs)}")
    return found


def _is_declared(log: UlogFile, topic: Topic) -> bool:
    """Whether the log has the topic with the same names of its fields."""
    known = log.formats.get(topic.name)
    declared = [] if known is None else [one.declared for one in known.all_fields]
    return declared == [one.declared for one in topic.all_fields]


def _short(value: float | str | None) -> str:
    if value is None:
        return "unknown"
    text = f"{value:.7g}" if isinstance(value, float) else str(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
