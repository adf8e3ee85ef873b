"""What a ground command does: a decision, without sockets."""

from __future__ import annotations

from collections.abc import Callable

from fsw.signals import CommandRequest
from fsw.vehicle.mission_commands import pause_or_continue, set_current, start_mission
from fsw.vehicle.mode_commands import (
    arm_or_disarm,
    enter,
    set_mode,
    set_standard_mode,
    take_off,
)
from fsw.vehicle.modes import Event
from fsw.vehicle.place_commands import reposition, set_actuator, set_home
from fsw.vehicle.situation import UNSUPPORTED, Decision, Situation

# MAV_CMD numbers of MAVLink common.xml.
CMD_NAV_LOITER_UNLIM = 17
CMD_NAV_RETURN_TO_LAUNCH = 20
CMD_NAV_LAND = 21
CMD_NAV_TAKEOFF = 22
CMD_DO_SET_MODE = 176
CMD_DO_SET_HOME = 179
CMD_DO_SET_ACTUATOR = 187
CMD_DO_REPOSITION = 192
CMD_DO_SET_STANDARD_MODE = 262
CMD_DO_PAUSE_CONTINUE = 193
CMD_DO_SET_MISSION_CURRENT = 224
CMD_MISSION_START = 300
CMD_ARM_DISARM = 400


def decide(request: CommandRequest, situation: Situation) -> Decision:
    """Accept a command with what it causes, or refuse it with a reason to act on."""
    judge = _JUDGES.get(request.command)
    if judge is None:
        return Decision(UNSUPPORTED, reason=f"command {request.command} is not supported")
    return judge(request, situation)


def _event(event: Event) -> Callable[[CommandRequest, Situation], Decision]:
    return lambda _, situation: enter(event, situation)


_JUDGES: dict[int, Callable[[CommandRequest, Situation], Decision]] = {
    CMD_NAV_LOITER_UNLIM: _event(Event.HOLD),
    CMD_NAV_RETURN_TO_LAUNCH: _event(Event.GO_HOME),
    CMD_NAV_LAND: _event(Event.LAND),
    CMD_NAV_TAKEOFF: take_off,
    CMD_DO_SET_MODE: set_mode,
    CMD_DO_SET_HOME: set_home,
    CMD_DO_SET_ACTUATOR: set_actuator,
    CMD_DO_REPOSITION: reposition,
    CMD_DO_SET_STANDARD_MODE: set_standard_mode,
    CMD_DO_PAUSE_CONTINUE: pause_or_continue,
    CMD_DO_SET_MISSION_CURRENT: set_current,
    CMD_MISSION_START: start_mission,
    CMD_ARM_DISARM: arm_or_disarm,
}
