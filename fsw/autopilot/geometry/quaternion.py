"""Unit quaternions [w, x, y, z] that map body components to world components (Hamilton).

Source: J. Solà, Quaternion kinematics for the error-state Kalman filter, 2017 (arXiv 1711.02508).
"""

from __future__ import annotations

import math

from fsw.autopilot.signals import Vec3, Vec4
from fsw.compiled import compilable


@compilable
def multiply(a: Vec4, b: Vec4) -> Vec4:
    """``a`` [1] times ``b`` [1]: first b, then a. Solà, eq 12."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@compilable
def conjugate(q: Vec4) -> Vec4:
    """The inverse rotation of ``q`` [1]."""
    return q[0], -q[1], -q[2], -q[3]


@compilable
def normalised(q: Vec4) -> Vec4:
    """``q`` [1] at unit length."""
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale


@compilable
def turned(q: Vec4, x: float, y: float, z: float) -> Vec4:
    """``q`` [1] followed by the rotation vector (``x`` [rad], ``y`` [rad], ``z`` [rad]), body axes.

    Solà, eq 101. Small angles take a series, exact to the last bit, instead of sine and cosine.
    """
    squared = 0.25 * (x * x + y * y + z * z)  # of half the angle
    if squared < 1e-3:
        real = 1.0 - squared * (0.5 - squared * (1.0 / 24.0 - squared / 720.0))
        part = 0.5 - squared * (1.0 / 12.0 - squared * (1.0 / 240.0 - squared / 10080.0))
    else:
        half = math.sqrt(squared)
        real, part = math.cos(half), 0.5 * math.sin(half) / half
    return normalised(multiply(q, (real, part * x, part * y, part * z)))


@compilable
def rotation_vector(q: Vec4) -> Vec3:
    """Axis times angle [rad] of ``q`` [1], the short way round. Solà, eq 105."""
    sign = 1.0 if q[0] >= 0.0 else -1.0
    size = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    scale = 2.0 * sign
    if size > 1e-9:
        scale = 2.0 * sign * math.atan2(size, sign * q[0]) / size
    return scale * q[1], scale * q[2], scale * q[3]
