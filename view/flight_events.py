"""What happened in a flight and when: modes, arming, failsafes, texts, commands."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.signals import CommandResult
from view.flight_data import FlightData
from view.scene import Event, EventKind

_WARNING: Final = 4  # MAV_SEVERITY


def events(flight: FlightData) -> tuple[Event, ...]:
    """Every event, in the order of time."""
    found = [*_status(flight), *_commands(flight)]
    for said in flight.texts:
        kind = EventKind.WARNING if said.severity <= _WARNING else EventKind.TEXT
        found.append(Event(said.t, kind, said.text))
    return tuple(sorted(found, key=lambda event: event.t))


def _status(flight: FlightData) -> list[Event]:
    """Changes of mode, arming and active faults."""
    table = flight.tables.get("vehicle_status")
    if table is None:
        return []
    found: list[Event] = []
    modes = [_text(value) for value in table["mode"]]
    faults = [_text(value) for value in table["failures"]]
    before: tuple[str, bool, str] = ("", False, "")
    for t, *now in zip(table.t.tolist(), modes, table["arming_state"] == 2, faults, strict=True):
        mode, armed, fault = str(now[0]), bool(now[1]), str(now[2])
        if mode != before[0]:
            found.append(Event(t, EventKind.MODE, f"mode {mode}"))
        if armed != before[1]:
            found.append(Event(t, EventKind.ARMING, "armed" if armed else "disarmed"))
        if fault != before[2]:
            found.append(Event(t, EventKind.FAULT, fault or "no failsafe any more"))
        before = mode, armed, fault
    return found


def _commands(flight: FlightData) -> list[Event]:
    """Every answer to a command."""
    table = flight.tables.get("vehicle_command_ack")
    if table is None:
        return []
    found = []
    for t, command, result in zip(table.t, table["command"], table["result"], strict=True):
        text = f"{command_name(int(command))}: {result_name(int(result))}"
        found.append(Event(float(t), EventKind.COMMAND, text))
    return found


def command_name(command: int) -> str:
    """As MAVLink names it."""
    from messages import dialect

    known = dialect.enums["MAV_CMD"].get(command)
    return f"command {command}" if known is None else known.name.removeprefix("MAV_CMD_")


def result_name(result: int) -> str:
    """What became of a command."""
    known = result in list(CommandResult)
    return CommandResult(result).name.lower().replace("_", " ") if known else f"result {result}"


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")
