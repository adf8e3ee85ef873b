"""What a ground command does: a decision, without sockets."""

from __future__ import annotations

from collections.abc import Callable

from fsw.signals import CommandRequest
from fsw.vehicle.guided_commands import (
    change_speed,
    check_arming,
    look,
    look_at,
    look_away,
    no_actuator_test,
    no_calibration,
    orbit,
)
from fsw.vehicle.mission_commands import pause_or_continue, set_current, start_mission
from fsw.vehicle.mode_commands import (
    arm_or_disarm,
    enter,
    set_mode,
    set_standard_mode,
    take_off,
    terminate,
)
from fsw.vehicle.modes import Event
from fsw.vehicle.place_commands import reposition, set_actuator, set_home
from fsw.vehicle.situation import UNSUPPORTED, Decision, Situation

# MAV_CMD numbers of MAVLink common.xml.
CMD_NAV_LOITER_UNLIM = 17
CMD_NAV_RETURN_TO_LAUNCH = 20
CMD_NAV_LAND = 21
CMD_NAV_TAKEOFF = 22
CMD_DO_ORBIT = 34
CMD_DO_SET_MODE = 176
CMD_DO_CHANGE_SPEED = 178
CMD_DO_SET_HOME = 179
CMD_DO_SET_ACTUATOR = 187
CMD_DO_REPOSITION = 192
CMD_DO_FLIGHTTERMINATION = 185
CMD_DO_SET_ROI_LOCATION = 195
CMD_DO_SET_ROI_NONE = 197
CMD_DO_SET_ROI = 201
CMD_DO_MOTOR_TEST = 209
CMD_PREFLIGHT_CALIBRATION = 241
CMD_DO_SET_STANDARD_MODE = 262
CMD_ACTUATOR_TEST = 310
CMD_RUN_PREARM_CHECKS = 401
CMD_DO_PAUSE_CONTINUE = 193
CMD_DO_SET_MISSION_CURRENT = 224
CMD_MISSION_START = 300
CMD_ARM_DISARM = 400


def decide(request: CommandRequest, situation: Situation) -> Decision:
    """Accept a command with what it causes, or refuse it with a reason to act on.

    What is not supported has no reason: ground stations probe for cameras, gimbals and much else,
    and a text for each would hide the texts that matter.
    """
    judge = _JUDGES.get(request.command)
    if judge is None:
        return Decision(UNSUPPORTED)
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
    CMD_DO_ORBIT: orbit,
    CMD_DO_CHANGE_SPEED: change_speed,
    CMD_DO_FLIGHTTERMINATION: terminate,
    CMD_DO_SET_ROI: look,
    CMD_DO_SET_ROI_LOCATION: look_at,
    CMD_DO_SET_ROI_NONE: look_away,
    CMD_DO_MOTOR_TEST: no_actuator_test,
    CMD_ACTUATOR_TEST: no_actuator_test,
    CMD_PREFLIGHT_CALIBRATION: no_calibration,
    CMD_RUN_PREARM_CHECKS: check_arming,
    CMD_DO_SET_STANDARD_MODE: set_standard_mode,
    CMD_DO_PAUSE_CONTINUE: pause_or_continue,
    CMD_DO_SET_MISSION_CURRENT: set_current,
    CMD_MISSION_START: start_mission,
    CMD_ARM_DISARM: arm_or_disarm,
}
