"""MAVLink's events interface: the newest events, and the document that says what they mean.

All links share the events, and each sends them.

An event is a number and the bytes of its arguments. The arming checks follow MAVLink's protocol of
health and arming checks: a summary, an event for each check that fails, and a summary of health.
Bits and numbers of health components and modes are PX4's, as clients know them.

Source: https://mavlink.io/en/services/events.html
"""

from __future__ import annotations

import json
import struct
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, cast

from fsw.autopilot.flight.commands.arming import CHECKS, Subject
from fsw.autopilot.flight.failsafe.conditions import Action, Condition
from fsw.autopilot.flight.failsafe.table import ROWS
from fsw.autopilot.flight.modes import MODES
from fsw.autopilot.signals import (
    ArmingReport,
    FailsafeEvent,
    Order,
    Severity,
    TickInputs,
    TickOutputs,
)
from fsw.link.services.service import LinkService
from fsw.link.text_limiter import REPEAT_US
from fsw.link.wire.decode import Numbers
from fsw.link.wire.identity import custom_mode
from fsw.link.wire.outgoing import Outgoing
from messages import message_ids
from messages.frames import Frame
from messages.message_ids import AUTOPILOT, SYSTEM_ID

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
_ANNOUNCED_US: Final = 3_000_000  # between two announcements of the newest, as PX4
_MOST: Final = 32  # answers to one request: it must not take longer than a tick can wait
_RESET: Final = 1  # MAV_EVENT_CURRENT_SEQUENCE_FLAGS
_UNAVAILABLE: Final = 0  # MAV_EVENT_ERROR_REASON
_MS: Final = 0xFFFFFFFF
_KEPT: Final = 64  # events; a client that missed more is told so
_BETWEEN_US: Final = 2_000_000  # two reports of the arming checks that no client asked for
_SEQUENCE: Final = 0x10000


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


@dataclass(frozen=True, slots=True)
class NumberedEvent:
    """An event, when it was and which one in the sequence."""

    event: Event
    t_us: int
    sequence: int


class EventLog:
    """What has happened; ``observe`` is called with the outputs of every tick."""

    def __init__(self) -> None:
        self.newest = 0  # sequence number of the last event
        self._kept: deque[NumberedEvent] = deque(maxlen=_KEPT)
        self._reported: ArmingReport | None = None  # the last one that was sent
        self._reported_us: int | None = None
        self._lately: dict[Event, int] = {}  # when each was; there are as many as conditions

    def observe(self, inputs: TickInputs, outputs: TickOutputs) -> None:
        """Take in what a tick heard and says."""
        snapshot = outputs.snapshot
        report, last_us = snapshot.arming, self._reported_us
        if report is self._reported and not outputs.texts and not inputs.commands:
            return  # as on almost every tick
        for text in outputs.texts:
            if text.event is not None:
                self._add_failsafe(failsafe_event(text.event), snapshot.t_us)
        # A vehicle that is armed refuses to be checked.
        asked = not snapshot.armed and any(
            one.action is Order.CHECK_ARMING for one in inputs.commands
        )
        waits = last_us is not None and snapshot.t_us - last_us < _BETWEEN_US
        if not asked and (waits or report == self._reported):
            return
        self._reported, self._reported_us = report, snapshot.t_us
        for event in arming_events(report):
            self._add(event, snapshot.t_us)

    def after(self, sequence: int) -> tuple[NumberedEvent, ...]:
        """Events that came after a ``sequence`` number [1]."""
        missing = (self.newest - sequence) % _SEQUENCE
        return tuple(self._kept)[-missing:] if missing else ()

    def find(self, sequence: int) -> NumberedEvent | None:
        """The event of a ``sequence`` number [1], None if it is not kept any more."""
        at = (sequence - self.oldest) % _SEQUENCE
        return self._kept[at] if at < len(self._kept) else None

    @property
    def oldest(self) -> int:
        """Sequence number of the oldest event that is kept."""
        return self._kept[0].sequence if self._kept else self.newest

    def _add_failsafe(self, event: Event, t_us: int) -> None:
        """Add it, a minor one once in a while only: some conditions come and go."""
        last_us = self._lately.get(event)
        if event.severity > Severity.CRITICAL:
            if last_us is not None and t_us - last_us < REPEAT_US:
                return
            self._lately[event] = t_us
        self._add(event, t_us)

    def _add(self, event: Event, t_us: int) -> None:
        self.newest = (self.newest + 1) % _SEQUENCE
        self._kept.append(NumberedEvent(event, t_us, self.newest))


class EventService(LinkService):
    """Sends events to the peers of one link, and again those that a client has missed."""

    message_ids = frozenset({message_ids.REQUEST_EVENT})

    def __init__(self, log: EventLog) -> None:
        self._log = log
        self._sent = log.newest
        self._announced_us: int | None = None

    def handle(self, frame: Frame, t_us: int) -> Sequence[Outgoing]:
        """Send events again; say of each that is not kept any more which the oldest is."""
        first, last, system, component = cast(Numbers, frame.payload_values)
        if system != SYSTEM_ID or component not in (0, AUTOPILOT):
            return ()
        count = min((int(last) - int(first)) % _SEQUENCE + 1, _MOST)
        answers = []
        for k in range(count):
            sequence = (int(first) + k) % _SEQUENCE
            found = self._log.find(sequence)
            if found is not None:
                answers.append(_sent(found))
                continue
            asker = (frame.system_id, frame.component_id)
            values = (sequence, self._log.oldest, *asker, _UNAVAILABLE)
            answers.append(Outgoing(message_ids.RESPONSE_EVENT_ERROR, values))
        return answers

    def poll(self, t_us: int) -> Sequence[Outgoing]:
        """What is new, and now and then the sequence number of the newest."""
        log, announced_us = self._log, self._announced_us
        due = announced_us is None or not 0 <= t_us - announced_us < _ANNOUNCED_US
        if self._sent == log.newest and not due:
            return ()
        messages = [_sent(one) for one in log.after(self._sent)]
        self._sent = log.newest
        if due:
            # Where nothing has been sent yet, what a client knows is of an earlier start.
            flags = _RESET if announced_us is None else 0
            self._announced_us = t_us
            first = log.newest if not messages else (log.newest - len(messages)) % _SEQUENCE
            current = Outgoing(message_ids.CURRENT_EVENT_SEQUENCE, (first, flags))
            messages = [current, *messages]
        return messages


def _sent(one: NumberedEvent) -> Outgoing:
    """EVENT to everybody."""
    arguments = one.event.arguments.ljust(ARGUMENTS, b"\0")
    levels = one.event.severity << 4 | one.event.severity
    return Outgoing(
        message_ids.EVENT,
        (one.event.id, one.t_us // 1000 & _MS, one.sequence, 0, 0, levels, *arguments),
    )
