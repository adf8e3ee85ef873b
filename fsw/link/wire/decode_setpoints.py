"""Offboard setpoints from wire values; pure. None: invalid, to be refused and counted.

Groups of three are used whole or not at all; a number that is not used may be NaN, one that is
used may not. What is out of range is for the vehicle to judge.
"""

from __future__ import annotations

import math
from typing import Final, cast

from fsw.link.wire.decode import Numbers
from fsw.signals import AttitudeSetpoint, JointSetpoint, MotionSetpoint, Vec2, Vec3, Vec4

_LOCAL_NED: Final = 1  # MAV_FRAME
_BODY_NED, _BODY_FRD = 8, 12
# POSITION_TARGET_TYPEMASK: what to ignore
_POSITION: Final = 0x007
_VELOCITY: Final = 0x038
_ACCELERATION: Final = 0x1C0
_FORCE: Final = 0x200  # the accelerations are forces
_YAW: Final = 0x400
_YAW_RATE: Final = 0x800
# ATTITUDE_TARGET_TYPEMASK: what to ignore
_RATES: Final = 0x07
_THRUST: Final = 0x40
_ATTITUDE: Final = 0x80
_JOINTS: Final = 2


def body_setpoint(values: Numbers) -> MotionSetpoint | None:
    """Read a SET_POSITION_TARGET_LOCAL_NED; positions only in the local frame."""
    along_heading = values[15] in (_BODY_NED, _BODY_FRD)
    if values[15] != _LOCAL_NED and not along_heading:
        return None
    setpoint = _motion(values[1:12], int(values[12]), of_end_effector=False)
    if setpoint is None or not along_heading:
        return setpoint
    if setpoint.p is not None:
        return None
    return MotionSetpoint(
        of_end_effector=False,
        p=None,
        v=setpoint.v,
        a=setpoint.a,
        yaw=setpoint.yaw,
        yaw_rate=setpoint.yaw_rate,
        along_heading=True,
    )


def end_effector_setpoint(values: Numbers) -> MotionSetpoint | None:
    """Read an END_EFFECTOR_TARGET without a time."""
    if values[15] != _LOCAL_NED:
        return None
    return _motion(values[1:12], int(values[12]), of_end_effector=True)


def attitude_setpoint(values: Numbers) -> AttitudeSetpoint | None:
    """Read a SET_ATTITUDE_TARGET: an attitude, or body rates, and a thrust."""
    mask, thrust = int(values[11]), values[8]
    q_WB, rates = cast(Vec4, values[1:5]), cast(Vec3, values[5:8])
    if mask & _THRUST or not math.isfinite(thrust):
        return None
    if not mask & _ATTITUDE:
        return AttitudeSetpoint(thrust, q_WB) if _finite(q_WB) else None
    if mask & _RATES or not _finite(rates):
        return None
    return AttitudeSetpoint(thrust, None, rates)


def joint_setpoint(values: Numbers) -> JointSetpoint | None:
    """Read an ARM_JOINT_SETPOINT; the planner finds velocities and accelerations itself."""
    q_arm = cast(Vec2, values[1:3])
    return JointSetpoint(q_arm) if values[15] == _JOINTS and _finite(q_arm) else None


def _motion(numbers: Numbers, mask: int, *, of_end_effector: bool) -> MotionSetpoint | None:
    """Position, velocity, acceleration, yaw and yaw rate by what a mask leaves."""
    partly = any(mask & group not in (0, group) for group in (_POSITION, _VELOCITY, _ACCELERATION))
    nothing = _POSITION | _VELOCITY | _ACCELERATION
    if partly or mask & _FORCE or mask & nothing == nothing:
        return None
    p = None if mask & _POSITION else cast(Vec3, numbers[0:3])
    v = None if mask & _VELOCITY else cast(Vec3, numbers[3:6])
    a = None if mask & _ACCELERATION else cast(Vec3, numbers[6:9])
    yaw = None if mask & _YAW else numbers[9]
    yaw_rate = None if mask & _YAW_RATE else numbers[10]
    used = (*(p or ()), *(v or ()), *(a or ()), yaw or 0.0, yaw_rate or 0.0)
    return (
        MotionSetpoint(of_end_effector=of_end_effector, p=p, v=v, a=a, yaw=yaw, yaw_rate=yaw_rate)
        if _finite(used)
        else None
    )


def _finite(numbers: tuple[float, ...]) -> bool:
    return all(map(math.isfinite, numbers))
