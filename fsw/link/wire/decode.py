"""From wire values to the boundary types; pure.

A MAVLink payload that is no setpoint, shape or place in a set is refused here by returning None,
and one with numbers out of ``flight.commands.bounds`` by ``RefusedError``, which says why; the
caller counts both. NaN in a COMMAND_LONG is normal: clients put it into every parameter that they
do not use.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Final, cast

from fsw.autopilot.flight.commands.bounds import reference_problem, zone_problem
from fsw.autopilot.shapes import BY_NUMBER, kind_of
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import (
    CommandRequest,
    EndEffectorTarget,
    SensorFrame,
    Shape,
    Touch,
    Vec3,
    Zone,
)
from messages.frames import Frame, wire_fields
from messages.joint_arrays import STATE_AT, joined
from messages.message_ids import AUTOPILOT, CMD_DO_SET_MODE, PANDION, SYSTEM_ID

Numbers = tuple[float, ...]  # a payload without text, in wire order

_LOCAL_NED: Final = 1  # MAV_FRAME_LOCAL_NED
_INT32_MAX: Final = 0x7FFFFFFF
_LOCAL_FRAMES: Final = frozenset({1, 7, 8, 9, 12})  # COMMAND_INT scales x, y by 1e4 here
_VELOCITY_IGNORED: Final = 0x038  # POSITION_TARGET_TYPEMASK
_ACCELERATION_IGNORED: Final = 0x1C0
_YAW_IGNORED: Final = 0x400
_POSITION_IGNORED: Final = 0x007
_ZERO: Final[Vec3] = (0.0, 0.0, 0.0)
MAX_ZONES: Final = 64  # in a set
_KEEP_IN: Final = 1  # PANDION_SHAPE_FLAGS
_TOUCH: Final = 2
FORCE_AT: Final = 16  # among the numbers of an END_EFFECTOR_TARGET
_TOUCH_AT: Final = 27  # of an OBSTACLE_SHAPE
_SET_AT: Final = 32  # of the same


class RefusedError(Exception):
    """Why a message for this vehicle is not believed, in a sentence."""


@dataclass(frozen=True, slots=True)
class IndexedObstacle:
    """One zone of a set of ``count``."""

    zone: Zone
    index: int
    count: int
    set_id: int = 0  # of all zones of the set; 0: not given


def for_this_vehicle(frame: Frame) -> bool:
    """Whether a frame is addressed to the autopilot or to everyone."""
    values, (system_at, component_at) = frame.payload_values, _target_at(frame.message_id)
    system = 0 if system_at is None else values[system_at]
    component = 0 if component_at is None else values[component_at]
    return system in (0, SYSTEM_ID) and component in (0, AUTOPILOT, PANDION)


@cache
def _target_at(message_id: int) -> tuple[int | None, int | None]:
    """Places of the target's system and component in wire order, as far as a message has them."""
    at = {name: place for place, name in enumerate(wire_fields(message_id))}
    return at.get("target_system"), at.get("target_component")


def sensor_frame(odometry: Frame, arm: Frame, hil_sensor: Frame, joints: int) -> SensorFrame:
    """Sensor readings of one step: ODOMETRY in local NED, ARM_JOINT_STATE and HIL_SENSOR.

    Of a vehicle with so many ``joints``.
    """
    state, angles = cast(Numbers, odometry.payload_values), cast(Numbers, arm.payload_values)
    _, px, py, pz, qw, qx, qy, qz, vx, vy, vz = state[:11]
    t_us, ax, ay, az, wx, wy, wz = cast(Numbers, hil_sensor.payload_values)[:7]
    position, velocity, _ = STATE_AT
    return SensorFrame(
        cast(int, t_us),
        p_WB=(px, py, pz),
        v_WB=(vx, vy, vz),
        q_WB=(qw, qx, qy, qz),
        gyro_B=(wx, wy, wz),
        accel_B=(ax, ay, az),
        q_arm=joined(angles, *position, joints),
        qd_arm=joined(angles, *velocity, joints),
    )


def command_long(frame: Frame) -> CommandRequest:
    """Read a COMMAND_LONG."""
    *params, command, _, _, confirmation = cast(Numbers, frame.payload_values)
    return CommandRequest(
        command=int(command),
        params=cast("tuple[float, float, float, float, float, float, float]", tuple(params)),
        source_system=frame.system_id,
        source_component=frame.component_id,
        confirmation=int(confirmation),
    )


def command_int(frame: Frame) -> CommandRequest:
    """Read a COMMAND_INT; parameters 5 and 6 come back in metres or degrees."""
    p1, p2, p3, p4, x, y, z, command, _, _, mav_frame, *_ = cast(Numbers, frame.payload_values)
    scale = 1e-4 if mav_frame in _LOCAL_FRAMES else 1e-7
    return CommandRequest(
        command=int(command),
        params=(p1, p2, p3, p4, _scaled(x, scale), _scaled(y, scale), z),
        source_system=frame.system_id,
        source_component=frame.component_id,
        frame=int(mav_frame),
    )


def set_mode(frame: Frame) -> CommandRequest:
    """Read a SET_MODE, the older form of DO_SET_MODE.

    It names PX4's main and sub mode in one number, and no component.
    """
    custom_mode, _, base_mode = cast("tuple[int, int, int]", frame.payload_values)
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24
    return CommandRequest(
        command=CMD_DO_SET_MODE,
        params=(float(base_mode), float(main), float(sub), *(math.nan,) * 4),
        source_system=frame.system_id,
        source_component=frame.component_id,
    )


def _scaled(number: float, scale: float) -> float:
    """An integer parameter; INT32_MAX is its NaN."""
    return math.nan if number == _INT32_MAX else number * scale


def end_effector_target(values: Numbers) -> EndEffectorTarget | None:
    """Read an END_EFFECTOR_TARGET; None if it is not a valid setpoint.

    A masked velocity, acceleration or yaw reads as zero; a target without a position or in another
    frame than local NED is none.
    """
    mask, frame = int(values[12]), values[15]
    if frame != _LOCAL_NED or mask & _POSITION_IGNORED:
        return None
    position = cast(Vec3, values[1:4])
    velocity = _ZERO if mask & _VELOCITY_IGNORED else cast(Vec3, values[4:7])
    acceleration = _ZERO if mask & _ACCELERATION_IGNORED else cast(Vec3, values[7:10])
    yaw = 0.0 if mask & _YAW_IGNORED else values[10]
    target = EndEffectorTarget(
        int(values[0]), position, velocity, acceleration, yaw, values[FORCE_AT]
    )
    problem = reference_problem(target)
    if problem is not None:
        raise RefusedError(f"target refused: {problem}")
    return target


def obstacle_wall(values: Numbers) -> IndexedObstacle | None:
    """Read an OBSTACLE_WALL; None if it has no place in its set."""
    zone = wall(cast(Vec3, values[0:3]), values[3], values[4])
    return _indexed(zone, *map(int, values[7:10]))


def obstacle_point(values: Numbers) -> IndexedObstacle | None:
    """Read an OBSTACLE_POINT; None if it keeps nothing away or has no place in its set."""
    if values[3] <= 0.0:
        return None
    zone = point(cast(Vec3, values[0:3]), values[3])
    return _indexed(zone, *map(int, values[6:9]))


def obstacle_shape(values: Numbers) -> IndexedObstacle | None:
    """Read an OBSTACLE_SHAPE; None if its kind is not known or it has no place in its set."""
    index, count, number, flags = map(int, values[23:27])
    kind = BY_NUMBER.get(number)
    if kind is None or flags & ~(_KEEP_IN | _TOUCH):
        return None
    clearance, velocity, keep_in = values[1], cast(Vec3, values[2:5]), bool(flags & _KEEP_IN)
    touch = Touch(*values[_TOUCH_AT : _TOUCH_AT + 5]) if flags & _TOUCH else None
    # One that stands is the same whenever it is announced.
    t_us = int(values[0]) if velocity != _ZERO else 0
    shape = Shape(kind.name, values[5 : 5 + kind.size])
    zone = Zone(shape, clearance, keep_in, velocity, t_us, touch)
    return _indexed(zone, index, count, int(values[_SET_AT]))


def workspace_sphere(values: Numbers) -> Zone:
    """Read a WORKSPACE_SPHERE."""
    return _bounded(target_sphere(cast(Vec3, values[0:3]), values[3]))


def _indexed(zone: Zone, index: int, count: int, set_id: int) -> IndexedObstacle | None:
    if not index < count <= MAX_ZONES:
        return None
    return IndexedObstacle(_bounded(zone), index, count, set_id)


def _bounded(zone: Zone) -> Zone:
    problem = kind_of(zone.shape).check(zone.shape) or zone_problem(zone)
    if problem is not None:
        raise RefusedError(f"{zone.shape.kind} refused: {problem}")
    return zone
