"""What happened in a flight and when: modes, arming, failsafes, texts, commands."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from view.flight_data import FlightData

_WARNING: Final = 4  # MAV_SEVERITY


class EventKind(Enum):
    """What an event is about."""

    MODE = "mode"
    ARMING = "arming"
    FAULT = "fault"
    COMMAND = "command"
    WARNING = "warning"
    TEXT = "text"


@dataclass(frozen=True, slots=True)
class FlightEvent:
    """One event."""

    t: float  # s, sensor time
    kind: EventKind
    text: str


def events(flight: FlightData) -> tuple[FlightEvent, ...]:
    """Every event, in the order of time."""
    found = [*_status(flight), *_commands(flight)]
    for said in flight.texts:
        kind = EventKind.WARNING if said.severity <= _WARNING else EventKind.TEXT
        found.append(FlightEvent(said.t, kind, said.text))
    return tuple(sorted(found, key=lambda event: event.t))


def _status(flight: FlightData) -> list[FlightEvent]:
    """Changes of mode, arming and active faults."""
    table = flight.tables.get("vehicle_status")
    if table is None:
        return []
    found: list[FlightEvent] = []
    modes = [_text(value) for value in table["mode"]]
    faults = [_text(value) for value in table["failures"]]
    before: tuple[str, bool, str] = ("", False, "")
    for t, *now in zip(table.t.tolist(), modes, table["arming_state"] == 2, faults, strict=True):
        mode, armed, fault = str(now[0]), bool(now[1]), str(now[2])
        if mode != before[0]:
            found.append(FlightEvent(t, EventKind.MODE, f"mode {mode}"))
        if armed != before[1]:
            found.append(FlightEvent(t, EventKind.ARMING, "armed" if armed else "disarmed"))
        if fault != before[2]:
            found.append(FlightEvent(t, EventKind.FAULT, fault or "no failsafe any more"))
        before = mode, armed, fault
    return found


def _commands(flight: FlightData) -> list[FlightEvent]:
    """Every answer to a command."""
    table = flight.tables.get("vehicle_command_ack")
    if table is None:
        return []
    from messages import dialect

    commands, results = dialect.enums["MAV_CMD"], dialect.enums["MAV_RESULT"]
    found = []
    for t, command, result in zip(table.t, table["command"], table["result"], strict=True):
        named = commands[int(command)].name if int(command) in commands else f"command {command}"
        answer = results[int(result)].name if int(result) in results else f"result {result}"
        text = f"{named.removeprefix('MAV_CMD_')}: {answer.removeprefix('MAV_RESULT_').lower()}"
        found.append(FlightEvent(float(t), EventKind.COMMAND, text))
    return found


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")
