"""Feeds a logged flight through the tick again and compares all that comes out.

The planner is not asked: its answers are inputs of the tick, and as such in the log.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fsw.log.compare import Difference, first_difference
from fsw.log.encoder import LogEncoder
from fsw.log.reader import Gap, UlogFile, ticks
from fsw.runtime.guarded_tick import GuardedTick
from fsw.runtime.program import FlightProgram

Progress = Callable[[int, int], None]
"""Takes bytes read and bytes in all."""

_TOLD_TICKS = 500


@dataclass(frozen=True, slots=True)
class Replayed:
    """What a replay found."""

    ticks: int  # that were compared
    difference: Difference | None
    lost_ms: int  # missing in the log behind these ticks; what follows cannot be fed


def replay(log: UlogFile, program: FlightProgram[Any], progress: Progress) -> Replayed:
    """Compare a log with what a program makes of its inputs, up to the first difference.

    Raises:
        UlogError: The log is damaged.
    """
    measured = log.information["pacing"] != "lockstep"
    facts = program.facts
    encoder = LogEncoder(
        measured=measured, thrust_max=facts.rotor_thrust_max, link_length=facts.link_length
    )
    tick = GuardedTick(program.tick, program.first_state)
    compared = 0
    for logged in ticks(log):
        if isinstance(logged, Gap):
            return Replayed(compared, None, logged.duration_ms)
        out = bytearray()
        encoder.add(logged.inputs, tick(logged.inputs), out)
        difference = first_difference(logged, bytes(out))
        if difference is not None:
            return Replayed(compared, difference, 0)
        compared += 1
        if compared % _TOLD_TICKS == 0:
            progress(log.at, log.size)
    progress(log.size, log.size)
    return Replayed(compared, None, 0)


def other_numbers(log: UlogFile, program: FlightProgram[Any]) -> tuple[str, ...]:
    """In which numbers of its configuration the program is not the one that was logged."""
    logged: dict[str, float] = json.loads(str(log.information["numbers"]))
    here = program.numbers
    return tuple(
        f"{name} is {here.get(name, 'unknown')} here and was {logged.get(name, 'unknown')}"
        for name in sorted({*logged, *here})
        if logged.get(name) != here.get(name)
    )
