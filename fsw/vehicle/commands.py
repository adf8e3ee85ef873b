"""What a ground command does: a decision, without sockets."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.signals import CommandRequest, Mode
from fsw.vehicle.modes import Event, next_mode

# MAV_CMD and MAV_RESULT numbers of MAVLink common.xml.
CMD_NAV_LAND = 21
CMD_NAV_TAKEOFF = 22
CMD_DO_SET_MODE = 176
CMD_ARM_DISARM = 400

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3

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
_FORCE = 21196.0  # the value MAVLink asks for to arm or disarm against all checks


@dataclass(frozen=True, slots=True)
class Situation:
    """What a decision may depend on."""

    mode: Mode
    landed: bool
    estimate_valid: bool
    targets_ahead: bool  # the stream holds a point at or after now
    standing_unclear: bool = False  # too high to stand, too low to be surely in the air
    inconsistent: str = ""  # why the configuration cannot keep the safe set
    mission_ready: bool = False  # a mission was uploaded and can be flown from here
    setpoint_fresh: bool = False  # an offboard set-point came within the last 0.5 s
    height: float = 0.0  # m, above the origin
    climb_range: tuple[float, float] = (0.3, 10.0)  # m, of a takeoff


@dataclass(frozen=True, slots=True)
class Decision:
    """Answer to a command: its MAV_RESULT, the event it causes and why not."""

    result: int
    event: Event | None = None
    reason: str = ""


def decide(request: CommandRequest, situation: Situation) -> Decision:
    """Accept a command with its event, or refuse it with a reason an operator can act on."""
    event = _requested_event(request)
    if isinstance(event, Decision):
        return event
    if event in (Event.ARM, Event.FOLLOW) and situation.inconsistent:
        # Waiting does not help: nothing but another configuration does.
        what = "not armed" if event is Event.ARM else "no trajectory"
        return Decision(DENIED, reason=f"{what}: {situation.inconsistent}")
    refusal = _refusal(event, request, situation)
    if refusal is not None:
        return Decision(TEMPORARILY_REJECTED, reason=refusal)
    if _already_there(event, situation.mode):
        return Decision(ACCEPTED)
    if next_mode(situation.mode, event) is None:
        return Decision(
            TEMPORARILY_REJECTED,
            reason=f"{event.value} is not possible while {situation.mode.value}",
        )
    return Decision(ACCEPTED, event)


def _requested_event(request: CommandRequest) -> Event | Decision:
    if request.command == CMD_ARM_DISARM:
        if request.params[0] == 1.0:
            return Event.ARM
        if request.params[0] == 0.0:
            return Event.DISARM
        return Decision(DENIED, reason="arm/disarm wants param1 = 1 or 0")
    if request.command == CMD_NAV_TAKEOFF:
        return Event.TAKE_OFF
    if request.command == CMD_NAV_LAND:
        return Event.LAND
    if request.command == CMD_DO_SET_MODE:
        main, sub = request.params[1], request.params[2]
        mode = _PX4_MODES.get((main, 0.0 if math.isnan(sub) else sub))
        if mode is not None:
            return mode
        return Decision(DENIED, reason=f"mode {main:g}/{sub:g} is not one of this vehicle")
    return Decision(UNSUPPORTED, reason=f"command {request.command} is not supported")


def _refusal(event: Event, request: CommandRequest, situation: Situation) -> str | None:
    forced = request.params[1] == _FORCE
    if event is Event.ARM and not situation.estimate_valid:
        return "not armed: the state estimate is invalid"
    if event is Event.ARM and situation.standing_unclear:
        return "not armed: neither standing nor clearly in the air; check the origin's height"
    flying = not situation.landed and situation.mode not in (Mode.DISARMED, Mode.FAULT)
    if event is Event.DISARM and flying and not forced:
        return "not disarmed: the vehicle is in the air; land first or force"
    if event is Event.TAKE_OFF:
        return _takeoff_refusal(request.params[6], situation)
    if event is Event.FOLLOW:
        return _trajectory_refusal(situation)
    if event is Event.GO_HOME and situation.landed:
        return "no return: the vehicle is on the ground"
    if event is Event.START_MISSION and not situation.mission_ready:
        return "no mission: none was uploaded"
    if event is Event.GO_OFFBOARD and not situation.setpoint_fresh:
        return "not offboard: no set-point was received in the last 0.5 s"
    return None


def _trajectory_refusal(situation: Situation) -> str | None:
    if situation.landed:
        return "no trajectory: the vehicle is on the ground; take off first"
    if not situation.targets_ahead:
        return "no trajectory: no END_EFFECTOR_TARGET ahead of now was received"
    return None


def _takeoff_refusal(height: float, situation: Situation) -> str | None:
    if situation.mode is Mode.DISARMED:
        return "no takeoff: the vehicle is not armed"
    if not situation.landed:
        return "no takeoff: the vehicle is in the air already"
    least, most = situation.climb_range
    if math.isfinite(height) and not (least <= height - situation.height <= most):
        low, high = situation.height + least, situation.height + most
        return f"no takeoff: height {height:g} m is outside {low:.1f} to {high:.1f} m"
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
