r"""Tilt and body rates within their limits, whatever a loop wants: the last law before the torques.

The rotors follow a commanded angular acceleration u with their lag :math:`\tau`. Seen that far
ahead the tilt :math:`\varphi`, a vector across the body's z axis, is a double integrator:
:math:`y = \varphi + \tau\omega`, :math:`\dot y = z = \omega + \tau\dot\omega`,
:math:`\dot z = u`. The command is changed as little as keeps

.. math:: |u + 2cz + c^2 y| \le c^2 \varphi_{max}.

That is a critically damped y with an input no longer than the limit, which never leaves it, in any
direction, nor does the tilt, which lags behind y. Body rates have the same of one order less.

Source: docs/equations.md T6; docs/decisions/0027-limits-that-hold.md.
"""

from __future__ import annotations

import math

from fsw.autopilot.geometry.vectors import clamp
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import Vec2, Vec3
from fsw.autopilot.tick_record import AnyEstimate
from fsw.compiled import compilable

_POLE = 12.0  # 1/s; quicker than the plan's own attitude (7), which it must not slow down


@compilable
def limited_turn(
    airframe: Airframe, estimate: AnyEstimate, turning: Vec3, wd: Vec3, left: float
) -> Vec3:
    """Angular acceleration ``wd`` [rad/s^2, FRD], as far as tilt and body rates allow.

    ``turning`` [rad/s^2, FRD] is the angular acceleration that there is. Of a vehicle that has a
    share ``left`` [1] of its torques the tilt stays within that share of its limit: a plan does not
    know how slowly it turns, and would make it swing.
    """
    lag, R = airframe.rotor_lag, estimate.R_WB
    wx, wy, wz = estimate.w_WB_B[0], estimate.w_WB_B[1], estimate.w_WB_B[2]
    zx, zy = wx + lag * turning[0], wy + lag * turning[1]
    most, most_yaw = airframe.body_rate_max
    x, y = _shortened(wd[0], wd[1], _POLE * zx, _POLE * zy, _POLE * most)
    # A turn about the horizontal axis along the body's z cross the vertical tilts it further.
    sine = math.hypot(R[6], R[7])
    size = math.atan2(sine, R[8]) / sine if sine > 0.0 else 1.0
    ahead_x, ahead_y = size * R[7] + lag * wx, -size * R[6] + lag * wy
    x, y = _shortened(
        x,
        y,
        _POLE * (2.0 * zx + _POLE * ahead_x),
        _POLE * (2.0 * zy + _POLE * ahead_y),
        _POLE * _POLE * airframe.tilt_max * left,
    )
    return x, y, clamp(wd[2], _POLE * (-most_yaw - wz), _POLE * (most_yaw - wz))


@compilable
def _shortened(x: float, y: float, to_x: float, to_y: float, most: float) -> Vec2:
    """The nearest (x, y) that together with another vector is no longer than the most."""
    length = math.hypot(x + to_x, y + to_y)
    if length <= most:
        return x, y
    scale = most / length
    return scale * (x + to_x) - to_x, scale * (y + to_y) - to_y
