"""``pandion replay``: what a flight log holds, and whether the code still does the same."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from command_line.options import json_file, option, read, switch
from command_line.output import console_beside, json_text, listed, print_error, say, write_text
from command_line.parser import COULD_NOT_START
from fsw.autopilot.signals import Origin
from pandion.display import Display
from vehicles.vehicle_file import parse_vehicle

if TYPE_CHECKING:
    from fsw.runtime.program import FlightProgram
    from messages.ulog_reader import UlogFile
    from pandion.flight_replay import Replayed

SAME, DIFFERS = 0, 1  # exit codes

_NOTES_SHOWN = 5
_NAMED = 20  # that are not compared


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayOptions:
    """One replay."""

    log: Path = option("LOG", "flight.ulg, or its directory", Path, required=True)
    verify: bool = switch(
        "--verify", "replay the inputs and compare the outputs; exit code 1 at the first difference"
    )
    json: str | None = json_file("the result")


def main(argv: list[str]) -> int:
    """Read a log, and compare if asked; returns the exit code."""
    what = "Show what a flight log holds, or replay its inputs."
    options = read(ReplayOptions, "pandion replay", what, argv)
    from messages.ulog_reader import UlogError
    from pandion.logged_ticks import open_flight

    try:
        log = open_flight(options.log)
        return _verify(options, log) if options.verify else _summarise(options, log)
    except (UlogError, ValueError, OSError) as error:
        print_error("pandion replay", error)
        return COULD_NOT_START


def _verify(options: ReplayOptions, log: UlogFile) -> int:
    from pandion.flight_replay import other_numbers, replay
    from pandion.replayed_definitions import compare_definitions

    console = console_beside(options.json)
    program = _program(log)
    numbers = other_numbers(log, program)
    _note(numbers, "numbers", console)
    display = Display(console, lines=0)
    with display.progress():
        found = replay(log, program, partial(display.share, "replaying"))
    definitions, unmade = compare_definitions(log, program, found)
    _note(definitions, "definitions", console)
    if found.same:
        say(f"note: not compared, for no tick makes it: {listed(unmade, _NAMED)}", console)
    say(_sentence(found, log), console)
    figures = {"log": str(log.path), "same": found.same, **dataclasses.asdict(found)}
    whole = not log.cut if found.same else log.whole  # the end was not read
    figures |= {"whole": whole, "other_numbers": list(numbers)}
    figures |= {"other_definitions": list(definitions), "not_compared": list(unmade)}
    write_text(options.json, json_text(figures, 2) + "\n")
    return SAME if found.same else DIFFERS


def _note(notes: Sequence[str], what: str, console: TextIO) -> None:
    for note in notes[:_NOTES_SHOWN]:
        say(f"note: {note}", console)
    if len(notes) > _NOTES_SHOWN:
        say(f"note: {len(notes) - _NOTES_SHOWN} more {what} differ", console)


def _program(log: UlogFile) -> FlightProgram:
    """The flight software of this build, configured by the names in the log."""
    from fsw.autopilot.parameters.control_choice import choice_of
    from fsw.runtime.assembly import flight_software
    from pandion.flight_replay import fact

    return flight_software(
        choice_of(partial(fact, log)),
        origin=_origin(log),
        vehicle=parse_vehicle(fact(log, "vehicle_file"), fact(log, "vehicle")),
        to_plan=False,
    )


def _origin(log: UlogFile) -> Origin:
    """Where the local frame of the flight began; not chosen by a name."""
    from messages.ulog_reader import UlogError
    from pandion.flight_replay import logged_numbers

    numbers = logged_numbers(log)
    try:
        parts = (numbers[f"origin.{part.name}"] for part in dataclasses.fields(Origin))
        return Origin(*map(float, parts))
    except (KeyError, TypeError, ValueError):
        raise UlogError(f"{log.path} is damaged: its origin is missing") from None


def _sentence(found: Replayed, log: UlogFile) -> str:
    difference = found.difference
    if difference is not None:
        return (
            f"first difference at tick {difference.tick} ({1e-6 * difference.t_us:.3f} s): "
            f"{difference.field} was {difference.logged!r} and is {difference.replayed!r}"
        )
    if found.lost_ms:
        return (
            f"no difference in {found.ticks} ticks; then {found.lost_ms} ms are missing "
            "in the log, and later ticks cannot be replayed"
        )
    cut = f"; the log {log.cut}" if log.cut else ""
    rest = "" if log.whole else " there, and an incomplete tick is not compared"
    return f"no difference in {found.ticks} ticks{cut}{rest}"


def _summarise(options: ReplayOptions, log: UlogFile) -> int:
    from pandion.log_summary import summary

    console = console_beside(options.json)
    display = Display(console, lines=0)
    with display.progress():
        result = summary(log, partial(display.share, "reading"))
    for name, value in result.items():
        if name not in ("topics", "texts"):
            say(f"{name:15} {value}", console)
    for name, count in result["topics"].items():
        say(f"  {name:34} {count:8d}", console)
    for text in result["texts"]:
        say(f"  {text}", console)
    write_text(options.json, json_text(result, 2) + "\n")
    return SAME
