"""Mission items as ground stations upload them, read one by one into steps of the vehicle.

An item that means nothing here is refused by an exception, ``BadItem``, with MAVLink's own result
and a sentence. NaN and 0 in parameters that a command does not use are normal; a NaN heading keeps
the heading.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, cast

from fsw.autopilot.flight.commands.bounds import (
    MAX_FORCE,
    MAX_REPEATS,
    MAX_SPEED,
    MAX_STAY,
    MAX_YAW,
    circle_problem,
)
from fsw.autopilot.signals import MAX_DISTANCE, MissionAction, MissionStep, Vec2, Vec3, Vec4
from fsw.link.wire.decode import Numbers
from fsw.link.wire.outgoing import Outgoing
from messages import dialect, message_ids

# What leaves the way as it is, and why it is skipped.
_NO_CAMERA: Final = "this vehicle has no camera"
SKIPPED: Final[dict[int, str]] = {
    189: "a return leads to home or a rally point",  # DO_LAND_START
    **dict.fromkeys((80, 196, 198, 200, 202, 203, 204, 205, 206, 214, 220, 260), _NO_CAMERA),
    **dict.fromkeys((530, 531, 532, 533, 534, 1000, 1001, 2000, 2001, 2003), _NO_CAMERA),
    **dict.fromkeys((2004, 2005, 2010, 2020, 2021, 2500, 2501, 2502, 2503), _NO_CAMERA),
}
# What a mission relies on: without it, it would be another one.
_MISSING: Final[dict[int, str]] = {
    181: "this vehicle has no relay",
    183: "this vehicle has no servo outputs",
    187: "the joints follow from where the end-effector is to be",
    207: "the fence is always in force",
    208: "this vehicle has no parachute",
    42600: "this vehicle has no winch",
}

# MAV_FRAME
GLOBAL_FRAMES: Final = frozenset({0, 5})
HOME_FRAMES: Final = frozenset({3, 6})  # global, altitude above home
LOCAL_NED: Final = 1
LOCAL_OFFSET_NED: Final = 7  # axes of local NED, origin travels with the vehicle
LOCAL_FRAMES: Final = frozenset({1, 7})  # x and y in 1e-4 m

# MAV_MISSION_RESULT
UNSUPPORTED_FRAME: Final = 2
UNSUPPORTED: Final = 3
INVALID: Final = 5
INVALID_PARAM1: Final = 6  # and so on up to parameter 7
DENIED: Final = 14

_FRAME_MISSION: Final = 2  # MAV_FRAME of a command without a place
NO_PLACE: Final = 2**31 - 1  # x or y of an item that names none, as MAVLink writes NaN there
LONGEST_STAY: Final = MAX_STAY  # s
WIDEST_ACCEPTANCE: Final = 10.0  # m
USUAL_ACCEPTANCE: Final = 0.1  # m
USUAL_RADIUS: Final = 2.0  # m, of a circle that names none

Peer = tuple[int, int]
"""System and component of a client."""
Locate = Callable[[float, float, float], Vec3]
"""Local NED [m] of a latitude and longitude [deg] and an altitude above the sea [m]."""


@dataclass(frozen=True, slots=True)
class MissionItem:
    """A MISSION_ITEM_INT as it came, so that a download returns it bit for bit."""

    command: int  # MAV_CMD
    frame: int  # MAV_FRAME
    params: Vec4  # parameters 1 to 4
    x: int  # 1e-7 deg of latitude, or 1e-4 m north in a local frame
    y: int
    z: float  # m
    autocontinue: int = 1


class BadItem(Exception):
    """Why something uploaded is of no use: a MAV_MISSION_RESULT and a sentence."""

    def __init__(self, result: int, reason: str) -> None:
        super().__init__(reason)
        self.result = result
        self.reason = reason


def item_int(values: Numbers) -> MissionItem:
    """Read a MISSION_ITEM_INT."""
    return MissionItem(
        command=int(values[8]),
        frame=int(values[11]),
        params=cast(Vec4, values[0:4]),
        x=int(values[4]),
        y=int(values[5]),
        z=values[6],
        autocontinue=int(values[13]),
    )


def item_float(values: Numbers) -> MissionItem:
    """Read a MISSION_ITEM, whose x and y are degrees or metres."""
    frame = int(values[11])
    whole = []
    for number, value in enumerate(values[4:6]):
        scaled = value * _scale(frame)
        if math.isnan(scaled):
            scaled = float(NO_PLACE)
        if not abs(scaled) <= NO_PLACE:
            raise BadItem(INVALID_PARAM1 + 4 + number, f"{value:g} is no place")
        whole.append(round(scaled))
    return item_int((*values[0:4], *whole, *values[6:]))


def encode_item(item: MissionItem, seq: int, kind: int, peer: Peer, as_int: bool) -> Outgoing:
    """MISSION_ITEM_INT, or MISSION_ITEM for a request in floats."""
    x: float = item.x
    y: float = item.y
    if not as_int:
        scale = _scale(item.frame)
        x = math.nan if item.x == NO_PLACE else item.x / scale
        y = math.nan if item.y == NO_PLACE else item.y / scale
    tail = (seq, item.command, *peer, item.frame, 0, item.autocontinue, kind)
    message_id = message_ids.MISSION_ITEM_INT if as_int else message_ids.MISSION_ITEM
    return Outgoing(message_id, (*item.params, x, y, item.z, *tail))


def command_name(command: int) -> str:
    """As MAVLink names a MAV_CMD, without what all begin with; the number of one it has not."""
    known = dialect.enums["MAV_CMD"]
    if command not in known:
        return f"command {command}"
    return str(known[command].name).removeprefix("MAV_CMD_")


def read_step(item: MissionItem, locate: Locate) -> MissionStep:
    """What an item means to this vehicle, or ``BadItem``."""
    reader = _READERS.get(item.command)
    if reader is None and item.command in SKIPPED:
        return MissionStep(MissionAction.SKIP, stop_after=not item.autocontinue)
    if reader is None:
        reason = _MISSING.get(item.command, "it is not one of this vehicle's missions")
        raise BadItem(UNSUPPORTED, f"{command_name(item.command)}: {reason}")
    return reader(item, locate)


def read_rally(item: MissionItem, locate: Locate) -> Vec2:
    """North and east of a rally point [m]; its altitude is not used, a return has its own."""
    if item.command != dialect.MAV_CMD_NAV_RALLY_POINT:
        raise BadItem(UNSUPPORTED, f"{command_name(item.command)} is no rally point")
    north, east, _ = _place(item, locate, "a rally point needs a place")
    return north, east


def horizontal_place(item: MissionItem, locate: Locate) -> Vec2:
    """North and east of an item's x and y [m]."""
    for number, value in ((5, item.x), (6, item.y)):
        if value == NO_PLACE:
            raise _bad(number, "a place is missing")
    if item.frame == LOCAL_NED:
        north, east = 1e-4 * item.x, 1e-4 * item.y
    elif item.frame in GLOBAL_FRAMES | HOME_FRAMES:
        latitude, longitude = 1e-7 * item.x, 1e-7 * item.y
        if not (abs(latitude) < 90.0 and abs(longitude) <= 180.0):
            raise _bad(5, f"{latitude:g}, {longitude:g} is no place on Earth")
        north, east, _ = locate(latitude, longitude, 0.0)
    else:
        raise BadItem(UNSUPPORTED_FRAME, f"frame {item.frame} is not supported for this item")
    for number, metres in ((5, north), (6, east)):
        if not abs(metres) <= MAX_DISTANCE:
            if _is_nowhere(item, locate):
                raise _bad(number, "latitude and longitude are both 0, which is no place here")
            raise _bad(number, f"{math.hypot(north, east):.0f} m from the origin is too far")
    return north, east


def _waypoint(item: MissionItem, locate: Locate) -> MissionStep:
    hold, acceptance = _stay(item, "a stay"), item.params[1]
    if not 0.0 <= acceptance <= WIDEST_ACCEPTANCE:
        raise _bad(2, f"an acceptance of {acceptance:g} m is outside 0 to {WIDEST_ACCEPTANCE:g} m")
    place = _place(item, locate, "a waypoint needs a place")
    return _go(item, place, hold, acceptance or USUAL_ACCEPTANCE)


def _loiter_to_height(item: MissionItem, locate: Locate) -> MissionStep:
    """Radius and exit are a fixed wing's: parameter 4 is no heading here."""
    return _loiter(replace(item, params=(*item.params[:3], math.nan)), locate, 0.0)


def _loiter_turns(item: MissionItem, locate: Locate) -> MissionStep:
    """Parameter 1 is the number of turns, 3 the radius, negative anticlockwise; 0: the usual."""
    turns, radius = item.params[0], item.params[2]
    if math.isnan(radius) or radius == 0.0:
        radius = USUAL_RADIUS
    step = _loiter_to_height(item, locate)
    problem = circle_problem(radius, turns)
    if problem is not None:
        raise BadItem(INVALID, problem)
    return replace(step, action=MissionAction.CIRCLE, radius=radius, turns=turns)


def _loiter(item: MissionItem, locate: Locate, hold: float) -> MissionStep:
    """At a place, or at a height where the vehicle is by then."""
    here = _is_nowhere(item, locate)
    place = (0.0, 0.0, _z(item, locate)) if here else _place(item, locate, "a place is missing")
    return replace(_go(item, place, hold, USUAL_ACCEPTANCE), here=here)


def _push(item: MissionItem, locate: Locate) -> MissionStep:
    """Parameter 1 is the force, 2 for how long, 4 the heading; NaN: towards the surface."""
    force, press_s = item.params[:2]
    if not 0.0 < force <= MAX_FORCE:
        raise _bad(1, f"a force of {force:g} N is outside 0 to {MAX_FORCE:g} N")
    if not 0.0 <= press_s <= LONGEST_STAY:
        raise _bad(2, f"pressing for {press_s:g} s is outside 0 to {LONGEST_STAY:g} s")
    step = _go(item, _place(item, locate, "a push needs a place"), 0.0, USUAL_ACCEPTANCE)
    return replace(step, action=MissionAction.PUSH, force=force, press_s=press_s)


def _grip(item: MissionItem, _: Locate) -> MissionStep:
    """Parameter 2 is what the gripper does: 0 releases, 1 grabs."""
    actions = {0.0: MissionAction.RELEASE, 1.0: MissionAction.GRIP}
    if item.params[1] not in actions:
        raise _bad(2, f"{item.params[1]:g} is neither 0, release, nor 1, grab")
    return MissionStep(actions[item.params[1]], stop_after=not item.autocontinue)


def _jump(item: MissionItem, _: Locate) -> MissionStep:
    """Parameter 1 is the item to go on with, 2 how often; -1: without end."""
    target, repeats = item.params[:2]
    if not (0.0 <= target < _MAX_ITEMS and target == int(target)):
        raise _bad(1, f"{target:g} is no number of an item")
    if not (-1.0 <= repeats <= MAX_REPEATS and repeats == int(repeats)):
        raise _bad(2, f"{repeats:g} jumps are outside 0 to {MAX_REPEATS}, or -1 without end")
    return MissionStep(
        MissionAction.JUMP,
        target=int(target),
        repeats=int(repeats),
        stop_after=not item.autocontinue,
    )


def _go(item: MissionItem, place: Vec3, hold: float, accept: float) -> MissionStep:
    return MissionStep(
        action=MissionAction.GO,
        position=place,
        above_home=item.frame in HOME_FRAMES,
        yaw=_heading(item.params[3]),
        hold_s=hold,
        acceptance=accept,
        stop_after=not item.autocontinue,
    )


def _take_off(item: MissionItem, locate: Locate) -> MissionStep:
    """Straight up: the place of a takeoff is where the vehicle stands."""
    return MissionStep(
        MissionAction.TAKE_OFF,
        (0.0, 0.0, _z(item, locate)),
        item.frame in HOME_FRAMES,
        _heading(item.params[3]),
        acceptance=USUAL_ACCEPTANCE,
        stop_after=not item.autocontinue,
    )


def _land(item: MissionItem, locate: Locate) -> MissionStep:
    yaw = _heading(item.params[3])
    if _is_nowhere(item, locate):
        return MissionStep(MissionAction.LAND, yaw=yaw)
    position = (*horizontal_place(item, locate), 0.0)  # the descent is the landing's
    return MissionStep(MissionAction.LAND, position, yaw=yaw, acceptance=USUAL_ACCEPTANCE)


def _delay(item: MissionItem, _: Locate) -> MissionStep:
    hold = _stay(item, "a delay")
    return MissionStep(MissionAction.DELAY, hold_s=hold, stop_after=not item.autocontinue)


def _change_speed(item: MissionItem, _: Locate) -> MissionStep:
    """Air speed and ground speed are one here; -1 and -2 mean the usual speed.

    A ground station writes what it takes for usual, QGroundControl 5 m/s: the mission is kept as
    it came and flown no faster than ``MAX_MISSION_SPEED``.
    """
    kind, speed = item.params[0], item.params[1]
    if kind not in (0.0, 1.0):
        raise _bad(1, f"speed type {kind:g} is neither air speed (0) nor ground speed (1)")
    if speed in (-1.0, -2.0):
        return MissionStep(MissionAction.SPEED)
    if not 0.01 <= speed <= MAX_SPEED:
        raise _bad(2, f"a speed of {speed:g} m/s is outside 0.01 to {MAX_SPEED:g} m/s")
    return MissionStep(MissionAction.SPEED, speed=speed)


def _look_at(item: MissionItem, locate: Locate) -> MissionStep:
    """The nose points there on the segments that follow; its height does not matter."""
    return MissionStep(MissionAction.LOOK_AT, (*horizontal_place(item, locate), 0.0))


def _look(item: MissionItem, locate: Locate) -> MissionStep:
    if item.params[0] == 0.0:
        return MissionStep(MissionAction.LOOK_AT)
    if item.params[0] == 3.0:
        return _look_at(item, locate)
    raise _bad(1, f"kind {item.params[0]:g} of a region of interest is not 0 or 3")


_MAX_ITEMS: Final = float(1 << 16)
_MAX_HEADING: Final = math.degrees(MAX_YAW)
_READERS: Final[dict[int, Callable[[MissionItem, Locate], MissionStep]]] = {
    dialect.MAV_CMD_NAV_WAYPOINT: _waypoint,
    dialect.MAV_CMD_NAV_LOITER_UNLIM: lambda item, locate: _loiter(item, locate, math.inf),
    dialect.MAV_CMD_NAV_LOITER_TIME: lambda item, locate: _loiter(
        item, locate, _stay(item, "a stay")
    ),
    dialect.MAV_CMD_NAV_LOITER_TURNS: _loiter_turns,
    dialect.MAV_CMD_NAV_LOITER_TO_ALT: _loiter_to_height,
    dialect.MAV_CMD_DO_JUMP: _jump,
    dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda *_: MissionStep(MissionAction.RETURN),
    dialect.MAV_CMD_NAV_LAND: _land,
    dialect.MAV_CMD_NAV_TAKEOFF: _take_off,
    dialect.MAV_CMD_NAV_DELAY: _delay,
    dialect.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    dialect.MAV_CMD_DO_SET_ROI_LOCATION: _look_at,
    dialect.MAV_CMD_DO_SET_ROI_NONE: lambda *_: MissionStep(MissionAction.LOOK_AT),
    dialect.MAV_CMD_DO_SET_ROI: _look,
    dialect.MAV_CMD_DO_GRIPPER: _grip,
    dialect.MAV_CMD_WAYPOINT_USER_1: _push,  # presses on a surface
}


def _is_nowhere(item: MissionItem, locate: Locate) -> bool:
    """Whether an item names no place: NaN, or 0, 0 on Earth, where the origin is elsewhere."""
    if item.x == item.y == NO_PLACE:
        return True
    if item.frame not in GLOBAL_FRAMES | HOME_FRAMES or item.x or item.y:
        return False
    return not math.hypot(*locate(0.0, 0.0, 0.0)[:2]) <= MAX_DISTANCE


def _place(item: MissionItem, locate: Locate, missing: str) -> Vec3:
    if item.x == NO_PLACE and item.y == NO_PLACE:
        raise _bad(5, missing)
    return (*horizontal_place(item, locate), _z(item, locate))


def _z(item: MissionItem, locate: Locate) -> float:
    """NED z of an item [m], from home where its frame says so."""
    if item.frame == LOCAL_NED:
        z = item.z
    elif item.frame in HOME_FRAMES:
        z = -item.z
    elif item.frame in GLOBAL_FRAMES:
        z = locate(0.0, 0.0, item.z)[2]
    else:
        raise BadItem(UNSUPPORTED_FRAME, f"frame {item.frame} is not supported for this item")
    if not -MAX_DISTANCE <= z <= 0.0:
        raise _bad(7, f"a height of {-z:g} m is outside 0 to {MAX_DISTANCE:g} m")
    return z


def _stay(item: MissionItem, what: str) -> float:
    """How long parameter 1 says [s]."""
    seconds = item.params[0]
    if not 0.0 <= seconds <= LONGEST_STAY:
        raise _bad(1, f"{what} of {seconds:g} s is outside 0 to {LONGEST_STAY:g} s")
    return seconds


def _heading(degrees: float) -> float | None:
    """The heading [rad] that parameter 4 names; NaN keeps it."""
    if math.isnan(degrees):
        return None
    if not abs(degrees) <= _MAX_HEADING:
        raise _bad(4, f"a heading of {degrees:g} deg is outside {_MAX_HEADING:g} deg either way")
    return math.radians(degrees)


def _bad(number: int, reason: str) -> BadItem:
    return BadItem(INVALID_PARAM1 + number - 1, reason)


def _scale(frame: int) -> float:
    if frame == _FRAME_MISSION:
        return 1.0
    return 1e4 if frame in LOCAL_FRAMES else 1e7
