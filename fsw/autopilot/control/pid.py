"""One PID loop, one tick; and the paper's loops of attitude and height, which consist of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.autopilot.geometry.rotation import euler_zyx, wrap_angle
from fsw.autopilot.geometry.vectors import Vector, clamp_magnitude
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.signals import Vec3
from fsw.autopilot.tick_record import (
    AnyEstimate,
    AnyInput,
    AnyPlan,
)
from fsw.compiled import compilable


@dataclass(frozen=True, slots=True)
class PidGains:
    """Gains and output limit of one loop."""

    kp: float
    ki: float
    kd: float
    limit: float


@compilable
def pid_step(
    gains: PidGains, integral: float, error: float, error_rate: float, dt: float
) -> tuple[float, float]:
    """Advance one PID loop by one tick.

    Args:
        gains: Gains and output limit.
        integral: Integral of error returned by the previous tick [error s].
        error: Reference minus measurement [error].
        error_rate: Reference rate minus measured rate [error/s].
        dt: Tick length [s], the nominal one, never a measured one.

    Returns:
        Output limited to ``+-gains.limit`` and the integral to pass back next tick.
    """
    grown = integral + error * dt
    raw = gains.kp * error + gains.ki * grown + gains.kd * error_rate
    output = clamp_magnitude(raw, gains.limit)
    # Integrating while saturated would have to be unwound before the output could leave
    # the limit; keep growth only when it pulls back inside.
    winding_up = raw != output and error * raw > 0.0
    return output, (integral if winding_up else grown)


@compilable
def attitude_reference(a: Vector, yaw: float) -> Vec3:
    """Roll, pitch and ``yaw`` [rad] whose thrust gives ``a`` [m/s^2, NED] (exact, ZYX)."""
    c, s = math.cos(yaw), math.sin(yaw)
    forward, right = c * a[0] + s * a[1], -s * a[0] + c * a[1]
    down = GRAVITY - a[2]
    pitch = math.atan2(-forward, down)
    roll = math.atan2(right, math.hypot(forward, down))
    return roll, pitch, yaw


@compilable
def attitude_pid(
    gains: PidGains, integral: Vector, estimate: AnyEstimate, reference: Vec3, dt: float
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


@compilable
def height_pid(
    airframe: Airframe,
    gains: PidGains,
    integral: float,
    estimate: AnyEstimate,
    plan: AnyPlan,
    u: AnyInput,
    dt: float,
) -> tuple[float, float]:
    """Total thrust [N] that keeps the planned height, and the integral to pass back.

    The plan's vertical acceleration is fed forward. ``integral`` [m s] of the height error, tick
    length ``dt`` [s].
    """
    error = plan.p[2] - estimate.p_WB[2]
    rate = plan.v[2] - estimate.v_WB[2]
    correction, kept = pid_step(gains, integral, error, rate, dt)
    a_z = u.a[2] + correction
    return airframe.mass * (GRAVITY - a_z) / max(estimate.R_WB[8], 0.5), kept
