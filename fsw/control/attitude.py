"""The paper's inner attitude loop and the references it follows."""

from __future__ import annotations

import math

from fsw.compiled import compilable
from fsw.control.pid import PidGains, pid_step
from fsw.geometry.rotation import euler_zyx, wrap_angle
from fsw.model.airframe import GRAVITY
from fsw.signals import StateEstimate, Vec3


@compilable
def attitude_reference(a: Vec3, yaw: float) -> Vec3:
    """Roll, pitch and yaw whose thrust direction gives an acceleration (exact, ZYX).

    Args:
        a: Commanded acceleration [m/s^2, NED].
        yaw: Commanded yaw [rad].
    """
    c, s = math.cos(yaw), math.sin(yaw)
    forward, right = c * a[0] + s * a[1], -s * a[0] + c * a[1]
    down = GRAVITY - a[2]
    pitch = math.atan2(-forward, down)
    roll = math.atan2(right, math.hypot(forward, down))
    return roll, pitch, yaw


@compilable
def attitude_pid(
    gains: PidGains,
    integral: Vec3,
    estimate: StateEstimate,
    reference: Vec3,
    dt: float,
) -> tuple[Vec3, Vec3]:
    """Angular acceleration that turns the vehicle to its attitude reference.

    Small-angle PID of the paper: body rates damp, Euler errors drive.

    Args:
        gains: On angle, its integral and rate.
        integral: Integrals of the errors [rad s, roll pitch yaw].
        estimate: The vehicle now.
        reference: Roll, pitch, yaw [rad, ZYX].
        dt: Tick length [s].

    Returns:
        Angular acceleration in the body [rad/s^2] and the integrals to pass back.
    """
    roll, pitch, yaw = euler_zyx(estimate.R_WB)
    wx, wy, wz = estimate.w_WB_B
    x, kept_x = pid_step(gains, integral[0], wrap_angle(reference[0] - roll), -wx, dt)
    y, kept_y = pid_step(gains, integral[1], wrap_angle(reference[1] - pitch), -wy, dt)
    z, kept_z = pid_step(gains, integral[2], wrap_angle(reference[2] - yaw), -wz, dt)
    return (x, y, z), (kept_x, kept_y, kept_z)
