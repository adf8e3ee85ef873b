"""Commands that arm, disarm and change the mode."""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.signals import CommandRequest, Mode
from fsw.vehicle.modes import Event, next_mode
from fsw.vehicle.places import Refused, height_of
from fsw.vehicle.situation import ACCEPTED, DENIED, TEMPORARILY_REJECTED, Decision, Situation

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
# Modes that can be chosen before arming, as ground stations do with a mission.
_STANDBY: dict[Event, Mode] = {Event.HOLD: Mode.HOLD, Event.START_MISSION: Mode.MISSION}
_FORCE = 21196.0  # the value MAVLink asks for to arm or disarm against all checks


def arm_or_disarm(request: CommandRequest, situation: Situation) -> Decision:
    """COMPONENT_ARM_DISARM; parameter 2 forces it against all checks but the estimate."""
    wish, forced = request.params[0], request.params[1] == _FORCE
    if wish == 1.0:
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


def arming_refusal(situation: Situation, *, forced: bool = False) -> str | None:
    """Why the vehicle cannot be armed now; force overrides all but a missing estimate."""
    if not situation.estimate_valid:
        return "not armed: the state estimate is invalid"
    if forced:
        return None
    if situation.standing_unclear:
        return "not armed: neither at rest on the ground nor clearly in the air; check the height"
    return f"not armed: {situation.inconsistent}" if situation.inconsistent else None


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
    refusal = _refusal(event, situation)
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


def _refusal(event: Event, situation: Situation) -> str | None:
    if event is Event.TAKE_OFF:
        return _takeoff_refusal(situation)
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
    """NAV_TAKEOFF, straight up from where it stands."""
    height = height_of(request, situation.origin, situation.home)
    if isinstance(height, Refused):
        return Decision(DENIED, reason=f"no takeoff: {height.reason}")
    decision = enter(Event.TAKE_OFF, situation)
    if height is None or decision.event is None:
        return decision
    here = -situation.position[2]
    least, most = situation.climb_range
    if not least <= height - here <= most:
        return Decision(
            TEMPORARILY_REJECTED,
            reason=f"no takeoff: height {height:.1f} m above the origin is outside "
            f"{here + least:.1f} to {here + most:.1f} m",
        )
    return replace(decision, climb=height - here)


def _takeoff_refusal(situation: Situation) -> str | None:
    if situation.mode is Mode.DISARMED:
        return "no takeoff: the vehicle is not armed"
    if not situation.landed:
        return "no takeoff: the vehicle is in the air already"
    return None


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
        Event.LAND: mode is Mode.LAND,
    }.get(event, False)
