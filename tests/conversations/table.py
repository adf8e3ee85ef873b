"""A conversation as a table: the messages sent, and the required answers, within which time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tests.conversations.connected import Connected, Message

Condition = Callable[[Any], bool]
Say = Callable[[Connected], Message | tuple[Message, ...]]


@dataclass(frozen=True)
class Must:
    """A message that has to come, and what has to be in it: values, or conditions on them."""

    type: str
    fields: Mapping[str, Any]
    within_s: float = 1.0

    def met_by(self, message: Message) -> bool:
        if message.get_type() != self.type:
            return False
        for name, wanted in self.fields.items():
            found = getattr(message, name)
            if not (wanted(found) if callable(wanted) else found == wanted):
                return False
        return True


@dataclass(frozen=True)
class Turn:
    """One row."""

    what: str
    say: Say
    must: tuple[Must, ...] = ()
    # Severity and below that no text may have meanwhile; 4 is a warning, 3 an error.
    no_text_below: int = 5


def ack(command: int, result: int = 0, within_s: float = 1.0) -> Must:
    """A COMMAND_ACK; ground stations wait 3 s, and 1 s is asked for here."""
    return Must("COMMAND_ACK", {"command": command, "result": result}, within_s)


def mode(custom_mode: int, within_s: float = 1.3, *, armed: bool | None = None) -> Must:
    """A HEARTBEAT with a mode; QGroundControl gives up after 1.3 s, three times."""
    fields: dict[str, Any] = {"custom_mode": custom_mode}
    if armed is not None:
        fields["base_mode"] = lambda base: bool(base & 128) is armed
    return Must("HEARTBEAT", fields, within_s)


def play(vehicle: Connected, turns: tuple[Turn, ...]) -> None:
    """Say one row after the other, and hold each answer against its row."""
    for turn in turns:
        begin = len(vehicle.heard)
        reported = turn.say(vehicle)
        for message in reported if isinstance(reported, tuple) else (reported,):
            vehicle.send(message)
        for must in turn.must:
            met = any(must.met_by(message) for message in vehicle.heard[begin:])
            if not met:
                met = vehicle.run(must.within_s, must.met_by) is not None
            assert met, f"{turn.what}: no {must.type} {dict(must.fields)}; {_seen(vehicle, begin)}"
        bad = [
            m.text
            for m in vehicle.heard[begin:]
            if m.get_type() == "STATUSTEXT" and m.severity < turn.no_text_below
        ]
        assert not bad, f"{turn.what}: {bad}"


def _seen(vehicle: Connected, begin: int) -> str:
    """What came instead, without telemetry."""
    telling = ("COMMAND_ACK", "STATUSTEXT", "MISSION_ACK", "PARAM_ERROR", "MISSION_REQUEST_INT")
    seen = [str(m) for m in vehicle.heard[begin:] if m.get_type() in telling]
    beats = [m for m in vehicle.heard if m.get_type() == "HEARTBEAT"]
    return f"came: {seen}, last {beats[-1] if beats else 'no heartbeat'}"


def latest(vehicle: Connected, kind: str) -> Message:
    """The last message of a kind, as a ground station shows it."""
    return next(m for m in reversed(vehicle.heard) if m.get_type() == kind)
