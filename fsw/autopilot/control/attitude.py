"""The paper's inner attitude loop and the references it follows."""

from __future__ import annotations

import math

from fsw.autopilot.control.pid import PidGains, pid_step
from fsw.autopilot.geometry.rotation import euler_zyx, wrap_angle
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.signals import StateEstimate, Vec3
from fsw.autopilot.tick_record import Estimate
from fsw.compiled import compilable
from fsw.record import Floats


@compilable
def attitude_reference(a: Vec3 | Floats, yaw: float) -> Vec3:
    """Roll, pitch and ``yaw`` [rad] whose thrust gives ``a`` [m/s^2, NED] (exact, ZYX)."""
    c, s = math.cos(yaw), math.sin(yaw)
    forward, right = c * a[0] + s * a[1], -s * a[0] + c * a[1]
    down = GRAVITY - a[2]
    pitch = math.atan2(-forward, down)
    roll = math.atan2(right, math.hypot(forward, down))
    return roll, pitch, yaw


@compilable
def attitude_pid(
    gains: PidGains,
    integral: Vec3 | Floats,
    estimate: StateEstimate | Estimate,
    reference: Vec3,
    dt: float,
) -> tuple[Vec3, Vec3]:
    """Angular acceleration [rad/s^2, FRD] towards an attitude, and the integrals to pass back.

    Small-angle PID of the paper: body rates damp, Euler errors drive. Of roll, pitch and yaw:
    ``integral`` [rad s, ZYX] and ``reference`` [rad, ZYX]. Tick length ``dt`` [s].
    """
    roll, pitch, yaw = euler_zyx(estimate.R_WB)
    w = estimate.w_WB_B
    x, kept_x = pid_step(gains, integral[0], wrap_angle(reference[0] - roll), -w[0], dt)
    y, kept_y = pid_step(gains, integral[1], wrap_angle(reference[1] - pitch), -w[1], dt)
    z, kept_z = pid_step(gains, integral[2], wrap_angle(reference[2] - yaw), -w[2], dt)
    return (x, y, z), (kept_x, kept_y, kept_z)
