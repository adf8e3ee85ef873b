"""Decodes MAVLink commands: parameters in, a typed action out; pure.

Invalid parameters are refused here with a sentence; NaN means the vehicle's default, and infinity
nothing. What depends on the state of the vehicle is decided in
``fsw.autopilot.flight.commands.handlers``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

from fsw.autopilot.flight.commands.bounds import CIRCLE_RADII, MAX_SPEED, MAX_YAW
from fsw.autopilot.flight.commands.handlers import MIN_SPEED
from fsw.autopilot.signals import (
    Arm,
    ChangeSpeed,
    Command,
    CommandAction,
    CommandRequest,
    CommandResult,
    Disarm,
    Facing,
    FlyOrbit,
    GoTo,
    Grip,
    InjectFailure,
    LookAt,
    Mode,
    MoveJoints,
    Order,
    Place,
    Rejected,
    SetHome,
    SetMissionStep,
    StartMission,
    SwitchMode,
    TakeOff,
)
from fsw.link.wire.identity import MODE_BY_PX4, MODE_BY_STANDARD
from fsw.link.wire.mission_items import (
    GLOBAL_FRAMES,
    HOME_FRAMES,
    LOCAL_NED,
    USUAL_RADIUS,
    Locate,
)
from messages import dialect

_FORCE: Final = 21196.0  # the value MAVLink asks for to arm or disarm against all checks
_FLAGS: Final = float(1 << 24)  # what a float holds whole
_UNCHANGED: Final = 5.0  # ORBIT_YAW_BEHAVIOUR: what an earlier orbit said, here the usual
_FACINGS: Final = {float(facing): facing for facing in Facing} | {_UNCHANGED: Facing.CENTRE}
_SPEED_TYPES: Final = (0.0, 1.0)  # SPEED_TYPE of air and ground, which are one here
_KEEP_SPEED, _USUAL_SPEED = -1.0, -2.0  # of DO_CHANGE_SPEED

_Reader = Callable[[CommandRequest, Locate], CommandAction]


class _InvalidError(Exception):
    """An invalid parameter."""


def command(request: CommandRequest, locate: Locate) -> Command:
    """A command with what it asks for; places on Earth are taken to local NED."""
    reader = _READERS.get(request.command)
    if reader is None:
        return Command(Rejected(CommandResult.UNSUPPORTED), request)
    try:
        for number, value in enumerate(request.params, start=1):
            if math.isinf(value):
                raise _InvalidError(f"command {request.command} refused: param{number} is infinite")
        return Command(reader(request, locate), request)
    except _InvalidError as error:
        return Command(Rejected(CommandResult.DENIED, str(error)), request)


def _arm_or_disarm(request: CommandRequest, _: Locate) -> CommandAction:
    wish, force = request.params[0], request.params[1] == _FORCE
    if wish == 1.0:
        return Arm(force)
    if wish == 0.0:
        return Disarm(force)
    raise _InvalidError("arm/disarm needs param1 = 1 or 0")


def _terminate(request: CommandRequest, _: Locate) -> CommandAction:
    if 0.5 < request.params[0] <= 1.0:
        return Order.TERMINATE
    raise _InvalidError("not terminated: param1 must be 1; it cannot be taken back")


def _set_mode(request: CommandRequest, _: Locate) -> CommandAction:
    """Without its flag parameter 2 is of no known meaning; QGroundControl and MAVSDK set it."""
    flags, main, sub = request.params[:3]
    if math.isnan(flags) or not (int(flags) & dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED):
        raise _InvalidError("mode unchanged: param1 lacks flag 1, custom mode")
    mode = MODE_BY_PX4.get((main, 0.0 if math.isnan(sub) else sub))
    if mode is None:
        raise _InvalidError(f"mode {main:g}/{sub:g} is not supported")
    return SwitchMode(mode)


def _take_off(request: CommandRequest, locate: Locate) -> CommandAction:
    return TakeOff(_height(request, locate, "no takeoff"))


def _reposition(request: CommandRequest, locate: Locate) -> CommandAction:
    speed, flags, _, yaw = request.params[:4]
    if abs(yaw) > MAX_YAW:
        raise _InvalidError(f"no goto: a heading of {yaw:g} rad is outside {MAX_YAW:.2f} rad")
    if speed > MAX_SPEED:
        raise _InvalidError(f"no goto: {speed:g} m/s is more than {MAX_SPEED:g} m/s")
    if not math.isnan(flags) and not 0.0 <= flags < _FLAGS:
        raise _InvalidError(f"no goto: flags {flags:g} are not a whole number of 24 bits")
    return GoTo(
        _place(request, locate, "no goto"),
        None if math.isnan(yaw) else yaw,
        speed if speed > 0.0 else None,
        may_switch_mode=not math.isnan(flags)
        and bool(int(flags) & dialect.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE),
    )


def _orbit(request: CommandRequest, locate: Locate) -> CommandAction:
    """Parameter 1 is the radius, negative anticlockwise, then speed, heading and turns."""
    radius, speed, behaviour, turns = request.params[:4]
    clockwise = not radius < 0.0
    radius = USUAL_RADIUS if math.isnan(radius) else abs(radius)
    least, most = CIRCLE_RADII
    if not least <= radius <= most:
        raise _InvalidError(
            f"no orbit: a radius of {radius:g} m is outside {least:g} to {most:g} m"
        )
    facing = Facing.CENTRE if math.isnan(behaviour) else _FACINGS.get(behaviour)
    if facing is None:
        known = "0 centre, 1 as it is, 3 tangent"
        raise _InvalidError(f"no orbit: heading {behaviour:g} is not one of {known}")
    if turns > 0.0:
        raise _InvalidError("no orbit: turns are not counted; param4 must be 0 or NaN")
    if abs(speed) < MIN_SPEED:
        raise _InvalidError(f"no orbit: {speed:g} m/s is not a valid speed")
    centre = _place(request, locate, "no orbit")
    return FlyOrbit(
        centre=centre,
        radius=radius,
        speed=None if math.isnan(speed) else abs(speed),
        clockwise=clockwise,
        facing=facing,
    )


def _look_at(request: CommandRequest, locate: Locate) -> CommandAction:
    """The height does not matter; a ground station that clicked on a map sends NaN for it."""
    if any(math.isnan(value) for value in request.params[4:6]):
        raise _InvalidError("no region of interest: latitude and longitude are needed")
    return LookAt(Place(_north_east(request, locate, "no region of interest")))


def _look(request: CommandRequest, locate: Locate) -> CommandAction:
    """DO_SET_ROI, the older form: parameter 1 says whether there is a place at all."""
    kind = request.params[0]
    if kind == dialect.MAV_ROI_NONE:
        return LookAt(None)
    if kind == dialect.MAV_ROI_LOCATION:
        return _look_at(request, locate)
    raise _InvalidError(f"kind {kind:g} of a region of interest is not 0 or 3")


def _change_speed(request: CommandRequest, _: Locate) -> CommandAction:
    kind, speed = request.params[:2]
    if kind not in _SPEED_TYPES:
        reason = f"speed type {kind:g} is neither air speed (0) nor ground speed (1)"
        raise _InvalidError(f"speed unchanged: {reason}")
    if speed == _KEEP_SPEED:
        return Order.NOTHING
    return ChangeSpeed(None if speed == _USUAL_SPEED else speed)


def _set_actuator(request: CommandRequest, _: Locate) -> CommandAction:
    """The actuators of index 0 are the joints."""
    *shares, index = request.params
    if not math.isnan(index) and index != 0.0:
        raise _InvalidError("no such actuators: the joints are those of index 0")
    if any(abs(value) > 1.0 for value in shares):
        raise _InvalidError("joints not moved: an actuator's range is -1 to 1")
    return MoveJoints(tuple([None if math.isnan(value) else value for value in shares]))


def _set_home(request: CommandRequest, locate: Locate) -> CommandAction:
    if request.params[0] == 1.0:
        return SetHome(None)
    if any(math.isnan(value) for value in request.params[4:7]):
        raise _InvalidError("home not set: latitude, longitude and altitude are needed")
    return SetHome(_place(request, locate, "home not set"))


def _start_mission(request: CommandRequest, _: Locate) -> CommandAction:
    return StartMission(*(0.0 if math.isnan(value) else value for value in request.params[:2]))


def _set_mission_step(request: CommandRequest, _: Locate) -> CommandAction:
    return SetMissionStep(request.params[0], request.params[1] == 1.0)


def _calibrate(request: CommandRequest, _: Locate) -> CommandAction:
    """All zeros cancel a calibration; none is running."""
    if all(value == 0.0 or math.isnan(value) for value in request.params):
        return Order.NOTHING
    # The prefix is how PX4 tells a ground station's calibration page.
    raise _InvalidError("[cal] calibration failed: these sensors need none")


def _inject_failure(request: CommandRequest, _: Locate) -> CommandAction:
    """Unit, failure and instance; which of them there are is the simulator's to say."""
    unit, kind, instance = (0.0 if math.isnan(value) else value for value in request.params[:3])
    if not all(0.0 <= value < 256.0 and value == int(value) for value in (unit, kind, instance)):
        numbers = f"{unit:g}, {kind:g} and {instance:g}"
        raise _InvalidError(f"no failure injected: {numbers} must be whole, 0 to 255")
    return InjectFailure(int(unit), int(kind), int(instance))


def _always(action: CommandAction) -> _Reader:
    return lambda *_: action


def _choice(number: int, actions: Mapping[float, CommandAction], refused: str) -> _Reader:
    """What parameter ``number`` [1] chooses; ``refused`` says why not, with its value."""

    def read(request: CommandRequest, _: Locate) -> CommandAction:
        wish = request.params[number - 1]
        if wish not in actions:
            raise _InvalidError(refused.format(wish))
        return actions[wish]

    return read


def _height(request: CommandRequest, locate: Locate, refused: str) -> Place:
    """The height that parameter 7 names."""
    z, frame = request.params[6], request.frame
    if math.isnan(z):
        return Place()
    if frame is None or frame in GLOBAL_FRAMES:
        return Place(height=-locate(0.0, 0.0, z)[2])
    if frame in HOME_FRAMES:
        return Place(height=z, above_home=True)
    if frame == LOCAL_NED:
        return Place(height=-z)
    wanted = "use global, relative or local NED"
    raise _InvalidError(f"{refused}: frame {frame} is not supported; {wanted}")


def _north_east(
    request: CommandRequest, locate: Locate, refused: str
) -> tuple[float, float] | None:
    """The place that parameters 5 and 6 name [m]; None: here."""
    x, y = request.params[4:6]
    if math.isnan(x) and math.isnan(y):
        return None
    if math.isnan(x) or math.isnan(y):
        raise _InvalidError(f"{refused}: the place is not finite")
    if request.frame == LOCAL_NED:
        return x, y
    if not (abs(x) <= 90.0 and abs(y) <= 180.0):
        raise _InvalidError(f"{refused}: {x:g}, {y:g} is not a latitude and longitude")
    return locate(x, y, 0.0)[:2]


def _place(request: CommandRequest, locate: Locate, refused: str) -> Place:
    height = _height(request, locate, refused)
    return Place(_north_east(request, locate, refused), height.height, height.above_home)


_NO_TEST: Final = (
    "no actuator test: rotors and joints move only in closed loop; arm and fly instead"
)
_READERS: Final[dict[int, _Reader]] = {
    dialect.MAV_CMD_NAV_LOITER_UNLIM: _always(SwitchMode(Mode.HOLD)),
    dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: _always(SwitchMode(Mode.RETURN)),
    dialect.MAV_CMD_NAV_LAND: _always(SwitchMode(Mode.LAND)),
    dialect.MAV_CMD_NAV_TAKEOFF: _take_off,
    dialect.MAV_CMD_DO_ORBIT: _orbit,
    dialect.MAV_CMD_DO_SET_MODE: _set_mode,
    dialect.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    dialect.MAV_CMD_DO_SET_HOME: _set_home,
    dialect.MAV_CMD_DO_FLIGHTTERMINATION: _terminate,
    dialect.MAV_CMD_DO_SET_ACTUATOR: _set_actuator,
    dialect.MAV_CMD_DO_REPOSITION: _reposition,
    dialect.MAV_CMD_DO_PAUSE_CONTINUE: _choice(
        1,
        {0.0: Order.PAUSE_MISSION, 1.0: Order.CONTINUE_MISSION},
        "pause/continue needs param1 = 0 or 1",
    ),
    dialect.MAV_CMD_DO_SET_ROI_LOCATION: _look_at,
    dialect.MAV_CMD_DO_SET_ROI_NONE: _always(LookAt(None)),
    dialect.MAV_CMD_DO_SET_ROI: _look,
    dialect.MAV_CMD_DO_MOTOR_TEST: _choice(1, {}, _NO_TEST),
    # There is one gripper, whatever its number; it holds what it holds.
    dialect.MAV_CMD_DO_GRIPPER: _choice(
        2,
        {0.0: Grip(closes=False), 1.0: Grip(closes=True), 2.0: Order.NOTHING},
        "gripper not moved: param2 = {:g}; 0 releases, 1 grabs, 2 holds",
    ),
    dialect.MAV_CMD_DO_SET_MISSION_CURRENT: _set_mission_step,
    dialect.MAV_CMD_PREFLIGHT_CALIBRATION: _calibrate,
    # What the autopilot is to do; other parameters are of other computers.
    dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _choice(
        1,
        {0.0: Order.NOTHING, 1.0: Order.RESTART},
        "not restarted: param1 = {:g}; 1 restarts, the console shuts down",
    ),
    dialect.MAV_CMD_DO_SET_STANDARD_MODE: _choice(
        1,
        {number: SwitchMode(mode) for number, mode in MODE_BY_STANDARD.items()},
        "standard mode {:g} is not supported",
    ),
    dialect.MAV_CMD_MISSION_START: _start_mission,
    dialect.MAV_CMD_ACTUATOR_TEST: _choice(1, {}, _NO_TEST),
    dialect.MAV_CMD_COMPONENT_ARM_DISARM: _arm_or_disarm,
    dialect.MAV_CMD_RUN_PREARM_CHECKS: _always(Order.CHECK_ARMING),
    dialect.MAV_CMD_INJECT_FAILURE: _inject_failure,
}
