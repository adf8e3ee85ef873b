"""Offboard setpoints: range checks and conversion."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.autopilot.flight.commands.bounds import MAX_RATE
from fsw.autopilot.geometry.rotation import euler_zyx, matrix_from_quaternion
from fsw.autopilot.geometry.vectors import clamp_magnitude
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.arm_coordinates import first_beyond
from fsw.autopilot.signals import AttitudeSetpoint, JointVector, MotionSetpoint, Vec3

_ROUNDING = 1e-6  # rad


@dataclass(frozen=True, slots=True)
class Tilt:
    """Attitude setpoint integrated from body rates."""

    roll: float = 0.0  # rad
    pitch: float = 0.0  # rad
    yaw: float = 0.0  # rad


def attitude_refusal(setpoint: AttitudeSetpoint) -> str | None:
    """Why an attitude is out of range."""
    if not 0.0 <= setpoint.thrust <= 1.0:
        return "thrust out of range"
    if setpoint.q_WB is not None and not abs(math.hypot(*setpoint.q_WB) - 1.0) < 0.01:
        return "the quaternion is not of length 1"
    if setpoint.w_WB_B is not None and not math.hypot(*setpoint.w_WB_B) <= MAX_RATE:
        return "body rates out of range"
    return None


def joints_refusal(q_arm: JointVector, airframe: Airframe) -> str | None:
    """Why the arm cannot have the angles ``q_arm`` (j,) [rad]."""
    if len(q_arm) != airframe.bodies.joints:
        return f"{len(q_arm)} joints are set, and the arm has {airframe.bodies.joints}"
    return first_beyond(airframe.angle_limits, q_arm, _ROUNDING)


def tilted(setpoint: AttitudeSetpoint, last: Tilt, most: float, dt: float) -> Tilt:
    """The attitude a setpoint asks for, roll and pitch at most ``most`` [rad].

    Rates go on from the last attitude for ``dt`` [s].
    """
    if setpoint.q_WB is not None:
        roll, pitch, yaw = euler_zyx(matrix_from_quaternion(setpoint.q_WB))
    else:
        wx, wy, wz = setpoint.w_WB_B or (0.0, 0.0, 0.0)
        s, c = math.sin(last.roll), math.cos(last.roll)
        turning = (wy * s + wz * c) / math.cos(last.pitch)
        roll = last.roll + dt * (wx + turning * math.sin(last.pitch))
        pitch = last.pitch + dt * (wy * c - wz * s)
        yaw = last.yaw + dt * turning
    return Tilt(clamp_magnitude(roll, most), clamp_magnitude(pitch, most), yaw)


def as_motion(tilt: Tilt, specific_thrust: float) -> MotionSetpoint:
    """The acceleration of an attitude and a thrust over the mass, ``specific_thrust`` [m/s^2].

    The planner flies it, and keeps the barriers.
    """
    sr, cr = math.sin(tilt.roll), math.cos(tilt.roll)
    sp, cp = math.sin(tilt.pitch), math.cos(tilt.pitch)
    sy, cy = math.sin(tilt.yaw), math.cos(tilt.yaw)
    a: Vec3 = (
        -specific_thrust * (cr * sp * cy + sr * sy),
        -specific_thrust * (cr * sp * sy - sr * cy),
        GRAVITY - specific_thrust * cr * cp,
    )
    return MotionSetpoint(of_end_effector=False, a=a, yaw=tilt.yaw)


def finite_or_zero(vector: Vec3) -> Vec3:
    """A vector [any unit, any frame] with 0 in the axes that a setpoint leaves open."""
    x, y, z = vector
    if math.isfinite(x + y + z):
        return vector
    return (
        0.0 if math.isnan(x) else x,
        0.0 if math.isnan(y) else y,
        0.0 if math.isnan(z) else z,
    )


def turn_level(ahead: Vec3, yaw: float) -> Vec3:
    """A vector ``ahead`` [any unit, ahead, right, down] in NED, of a vehicle at ``yaw`` [rad]."""
    c, s = math.cos(yaw), math.sin(yaw)
    return c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1], ahead[2]
