"""Commands that arm, disarm and change the mode."""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.signals import Charge, CommandRequest, Mode
from fsw.vehicle.modes import Event, next_mode
from fsw.vehicle.places import Refused, height_of
from fsw.vehicle.situation import (
    ACCEPTED,
    CLIMB_TOLERANCE,
    DENIED,
    TEMPORARILY_REJECTED,
    Decision,
    Situation,
)

# PX4's custom_mode, main and sub mode as carried by DO_SET_MODE.
_PX4_MODES: dict[tuple[float, float], Event] = {
    (4.0, 2.0): Event.TAKE_OFF,
    (4.0, 3.0): Event.HOLD,
    (4.0, 4.0): Event.START_MISSION,
    (4.0, 5.0): Event.GO_HOME,
    (4.0, 6.0): Event.LAND,
    (4.0, 11.0): Event.FOLLOW,  # the first mode that is not PX4's own
    (6.0, 0.0): Event.GO_OFFBOARD,
}
_STANDARD_MODES: dict[float, Event] = {  # MAV_STANDARD_MODE
    5.0: Event.GO_HOME,
    6.0: Event.START_MISSION,
    7.0: Event.LAND,
    8.0: Event.TAKE_OFF,
}
# What arming leads on to where a mode was chosen before it, as ground stations do.
STANDBY_EVENTS: dict[Mode, Event] = {
    Mode.TAKEOFF: Event.TAKE_OFF,
    Mode.MISSION: Event.START_MISSION,
    Mode.OFFBOARD: Event.GO_OFFBOARD,
}
_STANDBY: dict[Event, Mode] = {Event.HOLD: Mode.HOLD} | {
    event: mode for mode, event in STANDBY_EVENTS.items()
}
_FORCE = 21196.0  # the value MAVLink asks for to arm or disarm against all checks


def arm_or_disarm(request: CommandRequest, situation: Situation) -> Decision:
    """COMPONENT_ARM_DISARM; parameter 2 forces it against all checks but the estimate."""
    wish, forced = request.params[0], request.params[1] == _FORCE
    if wish == 1.0:
        return arm(situation, forced=forced)
    if wish == 0.0:
        flying = not situation.landed and situation.mode not in (Mode.DISARMED, Mode.FAULT)
        if flying and not forced:
            return Decision(
                TEMPORARILY_REJECTED,
                reason="not disarmed: the vehicle is in the air; land first or force",
            )
        decision = change(Event.DISARM, situation)
        if flying and decision.event is not None:
            who = f"{request.source_system}/{request.source_component}"
            reason = f"disarmed in the air, by force of {who}: the rotors stop"
            return replace(decision, reason=reason, alarming=True)
        return decision
    return Decision(DENIED, reason="arm/disarm wants param1 = 1 or 0")


def arm(situation: Situation, *, forced: bool = False) -> Decision:
    """Arm, if nothing stands against it."""
    refusal = arming_refusal(situation, forced=forced)
    if refusal is not None and situation.mode is Mode.DISARMED:
        # Waiting does not help against a configuration: nothing but another one does.
        permanent = bool(situation.inconsistent) and refusal.endswith(situation.inconsistent)
        return Decision(DENIED if permanent else TEMPORARILY_REJECTED, reason=refusal)
    decision = change(Event.ARM, situation)
    ignored = arming_refusal(situation, forced=False) if forced else None
    if decision.event is not None and ignored is not None:
        return replace(decision, reason=f"armed by force; {ignored}", alarming=True)
    return decision


def arming_refusal(situation: Situation, *, forced: bool = False) -> str | None:
    """Why the vehicle cannot be armed now; force overrides all but a missing estimate."""
    if not situation.estimate_valid:
        return "not armed: the state estimate is invalid"
    if forced:
        return None
    if situation.standing_unclear:
        return "not armed: neither at rest on the ground nor clearly in the air; check the height"
    if situation.charge >= Charge.CRITICAL:
        return "not armed: the battery is nearly empty"
    return f"not armed: {situation.inconsistent}" if situation.inconsistent else None


def terminate(request: CommandRequest, situation: Situation) -> Decision:
    """DO_FLIGHTTERMINATION: the rotors stop at once and for good."""
    if not request.params[0] > 0.5:
        return Decision(ACCEPTED)
    if situation.mode in (Mode.DISARMED, Mode.FAULT):
        return Decision(DENIED, reason="not terminated: the vehicle is not armed")
    who = f"{request.source_system}/{request.source_component}"
    reason = f"flight terminated by {who}: the rotors stop"
    return Decision(ACCEPTED, Event.TERMINATE, reason=reason, alarming=True)


def set_mode(request: CommandRequest, situation: Situation) -> Decision:
    """DO_SET_MODE with PX4's numbers."""
    main, sub = request.params[1], request.params[2]
    event = _PX4_MODES.get((main, 0.0 if math.isnan(sub) else sub))
    if event is None:
        return Decision(DENIED, reason=f"mode {main:g}/{sub:g} is not one of this vehicle")
    return enter(event, situation)


def set_standard_mode(request: CommandRequest, situation: Situation) -> Decision:
    """DO_SET_STANDARD_MODE."""
    event = _STANDARD_MODES.get(request.params[0])
    if event is None:
        reason = f"standard mode {request.params[0]:g} is not one of this vehicle"
        return Decision(DENIED, reason=reason)
    return enter(event, situation)


def enter(event: Event, situation: Situation) -> Decision:
    """Change the mode if everything that the new one needs is there."""
    if event is Event.FOLLOW and situation.inconsistent:
        return Decision(DENIED, reason=f"no trajectory: {situation.inconsistent}")
    refusal = entry_refusal(event, situation)
    if refusal is not None:
        return Decision(TEMPORARILY_REJECTED, reason=refusal)
    if situation.mode is Mode.DISARMED and event in _STANDBY:
        return Decision(ACCEPTED, standby=_STANDBY[event])
    return change(event, situation)


def change(event: Event, situation: Situation) -> Decision:
    """Change the mode where the table allows it; accept what is so already."""
    if _already_there(event, situation.mode):
        return Decision(ACCEPTED, stop=event is Event.HOLD)
    if next_mode(situation.mode, event) is None:
        reason = f"{event.value} is not possible while {situation.mode.value}"
        return Decision(TEMPORARILY_REJECTED, reason=reason)
    return Decision(ACCEPTED, event)


def entry_refusal(event: Event, situation: Situation) -> str | None:
    """What a mode needs and is not there."""
    if event is Event.TAKE_OFF and not situation.landed and situation.mode is not Mode.TAKEOFF:
        return "no takeoff: the vehicle is in the air already"
    if event is Event.FOLLOW and situation.landed:
        return "no trajectory: the vehicle is on the ground; take off first"
    if event is Event.FOLLOW and not situation.targets_ahead:
        return "no trajectory: no END_EFFECTOR_TARGET ahead of now was received"
    if event is Event.GO_HOME and situation.mode is Mode.DISARMED:
        return "no return: the vehicle is not armed"
    if event is Event.GO_HOME and situation.landed:
        return "no return: the vehicle is on the ground"
    if event is Event.START_MISSION:
        return situation.mission_refusal
    if event is Event.GO_OFFBOARD and not situation.setpoint_fresh:
        return "not offboard: no set-point was received in the last 0.5 s"
    return None


def take_off(request: CommandRequest, situation: Situation) -> Decision:
    """NAV_TAKEOFF, straight up from where it stands; before arming, as soon as it is armed."""
    height = height_of(request, situation.origin, situation.home)
    if isinstance(height, Refused):
        return Decision(DENIED, reason=f"no takeoff: {height.reason}")
    decision = enter(Event.TAKE_OFF, situation)
    if height is None or (decision.event is None and decision.standby is None):
        return decision
    here = -situation.position[2]
    least, most = situation.climb_range
    climb = height - here
    if not least - CLIMB_TOLERANCE <= climb <= most + CLIMB_TOLERANCE:
        return Decision(
            TEMPORARILY_REJECTED,
            reason=f"no takeoff: height {height:.1f} m above the origin is outside "
            f"{here + least:.1f} to {here + most:.1f} m",
        )
    return replace(decision, climb=min(max(climb, least), most))


def _already_there(event: Event, mode: Mode) -> bool:
    return {
        Event.ARM: mode not in (Mode.DISARMED, Mode.FAULT),
        Event.DISARM: mode in (Mode.DISARMED, Mode.FAULT),
        Event.TAKE_OFF: mode is Mode.TAKEOFF,
        Event.HOLD: mode is Mode.HOLD,
        Event.FOLLOW: mode is Mode.TRAJECTORY,
        Event.START_MISSION: mode is Mode.MISSION,
        Event.GO_HOME: mode is Mode.RETURN,
        Event.GO_OFFBOARD: mode is Mode.OFFBOARD,
        Event.CIRCLE: mode is Mode.ORBIT,
        Event.LAND: mode is Mode.LAND,
    }.get(event, False)
