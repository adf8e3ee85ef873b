"""Offboard setpoints from wire values; pure.

What is of no use is refused: each reader raises ``RefusedError``, which says why.

An axis is used or not by the message's mask, as PX4 takes it; a number that is not used may be NaN,
one that is used may not. Each axis needs a position, a velocity or an acceleration.
"""

from __future__ import annotations

import math
from typing import Final, cast

from fsw.autopilot.flight.commands.bounds import motion_refusal
from fsw.autopilot.flight.setpoints.offboard_setpoint import attitude_refusal
from fsw.autopilot.signals import (
    AttitudeSetpoint,
    JointSetpoint,
    MotionSetpoint,
    PositionFrom,
    Vec3,
    Vec4,
)
from fsw.link.wire.decode import FORCE_AT, Numbers, RefusedError
from fsw.link.wire.mission_items import GLOBAL_FRAMES, HOME_FRAMES, Locate
from messages.joint_arrays import JOINTS_MAX, SETPOINT_AT, SETPOINT_COUNT_AT, joined

# MAV_FRAME, with what a position counts from there; the others have no meaning for a setpoint.
_LOCAL_NED: Final = 1
_LOCAL_OFFSET_NED: Final = 7
_BODY_NED: Final = 8
_ALONG_HEADING: Final = frozenset({_BODY_NED, 9, 12})  # and BODY_OFFSET_NED, BODY_FRD
_TERRAIN: Final = frozenset({10, 11})
# POSITION_TARGET_TYPEMASK: what to ignore, each group from bit 0, 3 and 6 on
_GROUP: Final = 0x007
_HORIZONTAL: Final = 0x003
_ACCELERATION: Final = 0x1C0
_FORCE: Final = 0x200  # the accelerations are forces
_YAW: Final = 0x400
_YAW_RATE: Final = 0x800
# ATTITUDE_TARGET_TYPEMASK: what to ignore
_RATES: Final = 0x07
_THRUST: Final = 0x40
_ATTITUDE: Final = 0x80


def body_setpoint(values: Numbers) -> MotionSetpoint:
    """Read a SET_POSITION_TARGET_LOCAL_NED."""
    return _local(values, of_end_effector=False)


def end_effector_setpoint(values: Numbers) -> MotionSetpoint:
    """Read an END_EFFECTOR_TARGET without a time, and so without a force."""
    if values[FORCE_AT] != 0.0:
        raise RefusedError("a force needs a time: stream targets ahead")
    return _local(values, of_end_effector=True)


def global_setpoint(locate: Locate, values: Numbers) -> MotionSetpoint:
    """Read a SET_POSITION_TARGET_GLOBAL_INT; ``locate`` takes places on Earth to local NED.

    Velocities and accelerations are north, east and down, as in PX4.
    """
    mask, frame = int(values[12]), values[15]
    if frame in _TERRAIN:
        raise RefusedError(f"frame {frame:g} counts heights from terrain, which is not known")
    if frame not in GLOBAL_FRAMES | HOME_FRAMES:
        raise RefusedError(f"frame {frame:g} is not global: 0, 5, or 3, 6 above home")
    latitude, longitude, altitude = 1e-7 * values[1], 1e-7 * values[2], values[3]
    if mask & _HORIZONTAL not in (0, _HORIZONTAL):
        raise RefusedError("latitude and longitude are used together or not at all")
    north, east = 0.0, 0.0
    if not mask & _HORIZONTAL:
        if not (abs(latitude) < 90.0 and abs(longitude) <= 180.0):
            raise RefusedError(f"{latitude:g}, {longitude:g} is no place on Earth")
        north, east, _ = locate(latitude, longitude, 0.0)
    above_home = frame in HOME_FRAMES
    z = -altitude if above_home else locate(0.0, 0.0, altitude)[2]
    p_from = PositionFrom.HOME_HEIGHT if above_home else PositionFrom.ORIGIN
    return _motion((north, east, z, *values[4:12]), mask, p_from=p_from)


def attitude_setpoint(values: Numbers) -> AttitudeSetpoint:
    """Read a SET_ATTITUDE_TARGET: an attitude, or body rates, and a thrust."""
    mask, thrust = int(values[11]), values[8]
    q_WB, rates = cast(Vec4, values[1:5]), cast(Vec3, values[5:8])
    if mask & _THRUST:
        raise RefusedError("an attitude needs a thrust, which type_mask ignores")
    if mask & _ATTITUDE and mask & _RATES:
        raise RefusedError("type_mask ignores the attitude and a body rate")
    setpoint = AttitudeSetpoint(thrust, None, rates)
    if not mask & _ATTITUDE:
        setpoint = AttitudeSetpoint(thrust, q_WB)
    problem = attitude_refusal(setpoint)
    if problem is not None:
        raise RefusedError(problem)
    return setpoint


def actuator_setpoint(_: Numbers) -> JointSetpoint:
    """Refuse a SET_ACTUATOR_CONTROL_TARGET: rotors and joints are the loops'."""
    raise RefusedError("SET_ACTUATOR_CONTROL_TARGET is not supported: loops drive actuators")


def joint_setpoint(values: Numbers) -> JointSetpoint:
    """Read an ARM_JOINT_SETPOINT."""
    count = int(values[SETPOINT_COUNT_AT])
    if not 0 < count <= JOINTS_MAX:
        raise RefusedError(f"it is for {count} joints; must be 1 to {JOINTS_MAX}")
    q_arm = joined(values, *SETPOINT_AT, count)
    if not all(map(math.isfinite, q_arm)):
        raise RefusedError("a joint angle is not finite")
    return JointSetpoint(q_arm)


def _local(values: Numbers, *, of_end_effector: bool) -> MotionSetpoint:
    mask, frame = int(values[12]), values[15]
    along_heading = frame in _ALONG_HEADING
    if frame not in (_LOCAL_NED, _LOCAL_OFFSET_NED) and not along_heading:
        raise RefusedError(f"frame {frame:g} is not one of 1, 7, 8, 9, 12")
    if frame == _BODY_NED and mask & _GROUP != _GROUP:
        # MAVLink has it count from the origin, PX4 passes it over, ArduPilot adds the vehicle's.
        raise RefusedError("a position in frame 8 is ambiguous; use 1, 7 or 9")
    if along_heading and any(
        mask >> shift & _HORIZONTAL not in (0, _HORIZONTAL) for shift in (0, 3, 6)
    ):
        raise RefusedError(f"in frame {frame:g}, x and y are used together or not at all")
    return _motion(
        values[1:12],
        mask,
        of_end_effector=of_end_effector,
        along_heading=along_heading,
        p_from=PositionFrom.ORIGIN if frame == _LOCAL_NED else PositionFrom.VEHICLE,
    )


def _motion(
    numbers: Numbers,
    mask: int,
    *,
    of_end_effector: bool = False,
    along_heading: bool = False,
    p_from: PositionFrom = PositionFrom.ORIGIN,
) -> MotionSetpoint:
    """Position, velocity, acceleration, yaw and yaw rate by what a mask leaves."""
    if mask & _FORCE and mask & _ACCELERATION != _ACCELERATION:
        raise RefusedError("forces are not supported")
    p, v, a = (_vector(numbers[k : k + 3], mask >> k) for k in (0, 3, 6))
    if p is None and v is None and a is None:
        raise RefusedError("type_mask ignores position, velocity and acceleration")
    setpoint = MotionSetpoint(
        of_end_effector=of_end_effector,
        p=p,
        v=v,
        a=a,
        yaw=None if mask & _YAW else _used(numbers[9]),
        yaw_rate=None if mask & _YAW_RATE else _used(numbers[10]),
        along_heading=along_heading,
        p_from=p_from if p is not None else PositionFrom.ORIGIN,
    )
    problem = motion_refusal(setpoint)
    if problem is not None:
        raise RefusedError(problem)
    return setpoint


def _vector(numbers: Numbers, ignored: int) -> Vec3 | None:
    """Three axes, NaN where bits 0 to 2 ignore one; None where they ignore all."""
    if ignored & _GROUP == _GROUP:
        return None
    x, y, z = (math.nan if ignored >> k & 1 else _used(one) for k, one in enumerate(numbers))
    return x, y, z


def _used(number: float) -> float:
    if math.isfinite(number):
        return number
    raise RefusedError("a number that type_mask uses is not finite")
