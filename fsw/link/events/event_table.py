"""The events of this vehicle, and the document from which a ground station learns what they mean.

An event is a number and the bytes of its arguments. The arming checks follow MAVLink's protocol of
health and arming checks: a summary, an event for each check that fails, and a summary of health.
Bits and numbers of health components and modes are PX4's, as clients know them.

Source: https://mavlink.io/en/services/events.html
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from fsw.autopilot.flight.commands.arming import CHECKS, Subject
from fsw.autopilot.flight.failsafe.conditions import Action, Condition
from fsw.autopilot.flight.failsafe.table import ROWS
from fsw.autopilot.flight.modes import MODES
from fsw.autopilot.signals import ArmingReport, FailsafeEvent, Severity
from fsw.link.wire.identity import custom_mode

ARGUMENTS: Final = 40  # bytes of an event
_COMPONENT: Final = 1  # of the ids: the autopilot
_VERSION: Final = 2  # of the document
_PROTOCOL: Final = 8  # log level of what is for programs and not for people
_EVERY_MODE: Final = 0xFFFFFFFF
_SUMMARY, _HEALTH, _BEGUN, _ENDED, _DELAYED = 1, 2, 10, 11, 12
_CHECK: Final = 100  # the first of the arming checks

# PX4's health_component_t: bits, names and what people read.
_COMPONENTS: Final = {
    5: ("vision_position", "Pose"),
    8: ("motors_escs", "Rotors and joints"),
    11: ("battery", "Battery"),
    16: ("attitude_estimate", "Attitude"),
    17: ("local_position_estimate", "Position"),
    20: ("system", "System"),
    25: ("storage", "Flight log"),
    28: ("accel", "Inertial unit and encoders"),
}
_BITS: Final = {
    Subject.TERMINATION: 20,
    Subject.ESTIMATOR: 17,
    Subject.ATTITUDE: 16,
    Subject.SENSORS: 28,
    Subject.STANDING: 17,
    Subject.BATTERY: 11,
    Subject.PARAMETERS: 20,
    Subject.SAFE_SET: 20,
    Subject.JOINTS: 8,
    Subject.ACTUATORS: 8,
    Subject.STORAGE: 25,
}
_PRESENT: Final = sum(1 << bit for bit in _COMPONENTS)
# PX4's navigation_mode_group_t: modes in which a vehicle can be armed.
_MODE_GROUPS: Final = {mode: kind.px4 for mode, kind in MODES.items() if kind.px4.offered}
# PX4's failsafe_action_t; behind its ten, ours.
_ACTIONS: Final = {
    Action.NONE: 0,
    Action.WARN: 1,
    Action.HOLD: 5,
    Action.RETURN: 6,
    Action.LAND: 7,
    Action.DESCEND: 8,
    Action.TERMINATE: 10,
    **{
        action: 20 + k
        for k, action in enumerate(
            (Action.REPLAN, Action.PUSH, Action.DEAD_RECKON, Action.BRAKE, Action.RETREAT)
        )
    },
}
# The names of these enumerations in the document.
_HEALTH_T, _MODE_T = "health_component_t", "navigation_mode_group_t"
_CONDITION_T, _ACTION_T = "condition_t", "failsafe_action_t"
_CONDITIONS: Final = {condition: number for number, condition in enumerate(Condition)}


@dataclass(frozen=True, slots=True)
class Event:
    """One event as it goes out."""

    id: int
    severity: int  # log level for people
    arguments: bytes  # at most ARGUMENTS


def arming_events(report: ArmingReport) -> tuple[Event, ...]:
    """The arming checks and the health: a summary, the checks that fail, and another summary.

    An armed vehicle has no checks that fail, but with an ill component it could not be armed again.
    """
    errors, warnings = 0, 0
    for number in report.failed:
        errors |= 1 << _BITS[CHECKS[number].subject]
    for name in report.ill:
        row = ROWS[Condition(name)]
        bit = 1 << _BITS[row.component] if row.component is not None else 0
        if row.severity <= Severity.CRITICAL:
            errors |= bit
        else:
            warnings |= bit
    can_arm = 0 if errors else _EVERY_MODE
    summary = struct.pack("<BIIII", 0, errors, warnings, can_arm, _EVERY_MODE)
    checks = [
        _event(
            _CHECK + number,
            Severity.CRITICAL,
            struct.pack("<IB", _EVERY_MODE, _BITS[CHECKS[number].subject]),
        )
        for number in report.failed
    ]
    health = struct.pack("<BIII", 0, _PRESENT, errors, warnings)
    return (_event(_SUMMARY, _PROTOCOL, summary), *checks, _event(_HEALTH, _PROTOCOL, health))


def failsafe_event(event: FailsafeEvent) -> Event:
    """A condition that has begun, with what is done about it now and later, or one that is over."""
    condition = _CONDITIONS[Condition(event.condition)]
    if event.over:
        return _event(_ENDED, event.severity, struct.pack("<B", condition))
    action = _ACTIONS[Action(event.action)]
    if event.later:
        later, seconds = _ACTIONS[Action(event.later)], round(1e-6 * event.delay_us)
        packed = struct.pack("<BBBB", condition, action, later, min(max(seconds, 0), 255))
        return _event(_DELAYED, event.severity, packed)
    return _event(_BEGUN, event.severity, struct.pack("<BB", condition, action))


def condition_of(id: int, arguments: bytes) -> tuple[Condition, bool] | None:
    """The failsafe condition that an event is about, and whether it is over; None: about none."""
    number = id - (_COMPONENT << 24)
    if (
        number not in (_BEGUN, _DELAYED, _ENDED)
        or not arguments
        or arguments[0] >= len(_CONDITIONS)
    ):
        return None
    return list(Condition)[arguments[0]], number == _ENDED


def _event(number: int, severity: int, arguments: bytes) -> Event:
    return Event(_COMPONENT << 24 | number, int(severity), arguments)


@cache
def event_document() -> bytes:
    """The document about all events, as JSON."""
    checks = {
        str(_CHECK + number): _described(
            f"check_{number}_{check.subject.name.lower()}",
            check.summary,
            f"{_MODE_T} modes",
            "uint8_t component",
        )
        for number, check in enumerate(CHECKS)
    }
    arming = _described(
        "arming_check_summary",
        "Arming checks",
        *("uint8_t chunk_idx", f"{_HEALTH_T} error", f"{_HEALTH_T} warning"),
        *(f"{_MODE_T} can_arm", f"{_MODE_T} can_run"),
        sums_up=True,
    )
    healthy = _described(
        "health_summary",
        "Health",
        *("uint8_t chunk_idx", f"{_HEALTH_T} is_present"),
        *(f"{_HEALTH_T} error", f"{_HEALTH_T} warning"),
        sums_up=True,
    )
    condition, action = f"{_CONDITION_T} condition", f"{_ACTION_T} action"
    begun = _described("failsafe", "{1}: {2}", condition, action)
    delayed = _described(
        "failsafe_delayed",
        "{1}: {2}, {3} in {4} s",
        *(condition, action, f"{_ACTION_T} later", "uint8_t delay_s"),
    )
    over = _described("failsafe_over", "Over: {1}", condition)
    described = {
        "namespace": "pandion",
        "enums": _enumerations(),
        "event_groups": {
            "arming_check": {"events": {str(_SUMMARY): arming, **checks}},
            "health": {"events": {str(_HEALTH): healthy}},
            "default": {"events": {str(_BEGUN): begun, str(_ENDED): over, str(_DELAYED): delayed}},
        },
        "supported_protocols": ["health_and_arming_check"],
        "navigation_mode_groups": {
            "groups": {
                str(px4.nav_state): [custom_mode(mode)] for mode, px4 in _MODE_GROUPS.items()
            }
        },
    }
    document = {"version": _VERSION, "components": {str(_COMPONENT): described}}
    return json.dumps(document, separators=(",", ":"), allow_nan=False).encode()


def _described(name: str, message: str, *arguments: str, sums_up: bool = False) -> dict[str, Any]:
    """An event and its ``arguments``, each a type and a name."""
    typed = [dict(zip(("type", "name"), one.split(), strict=True)) for one in arguments]
    kind = {"type": "summary"} if sums_up else {}
    return {"name": name, "message": message, **kind, "arguments": typed}


def _enumerations() -> dict[str, Any]:
    conditions = {_CONDITIONS[row]: (row.name.lower(), row.value) for row in ROWS}
    actions = {number: (action.name.lower(), action.value) for action, number in _ACTIONS.items()}
    groups = {1 << px4.nav_state: (px4.name, px4.name) for px4 in _MODE_GROUPS.values()}
    components = {1 << bit: names for bit, names in _COMPONENTS.items()}
    return {
        _HEALTH_T: _enumeration("uint32_t", components, bitfield=True),
        _MODE_T: _enumeration("uint32_t", groups, bitfield=True),
        _CONDITION_T: _enumeration("uint8_t", conditions),
        _ACTION_T: _enumeration("uint8_t", actions),
    }


def _enumeration(
    kind: str, entries: dict[int, tuple[str, str]], *, bitfield: bool = False
) -> dict[str, Any]:
    described = {
        str(number): {"name": name, "description": text}
        for number, (name, text) in sorted(entries.items())
    }
    return {"type": kind, "is_bitfield": bitfield, "entries": described}
