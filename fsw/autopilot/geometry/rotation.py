"""Rotations as nine floats, row-major, mapping body components to world components."""

from __future__ import annotations

import math

from fsw.autopilot.geometry.vectors import Vector, clamp_magnitude
from fsw.autopilot.signals import Mat3, Vec3, Vec4
from fsw.compiled import compilable
from fsw.record import Floats

Axes = Mat3 | Floats  # compiled code may hand over nine entries of an array


@compilable
def matrix_from_quaternion(q: Vec4) -> Mat3:
    """Rotation matrix of a quaternion ``q`` [1], (w, x, y, z), close to unit length."""
    w, x, y, z = q
    s = 2.0 / (w * w + x * x + y * y + z * z)
    xs, ys, zs = x * s, y * s, z * s
    wx, wy, wz = w * xs, w * ys, w * zs
    xx, xy, xz = x * xs, x * ys, x * zs
    yy, yz, zz = y * ys, y * zs, z * zs
    return (
        1.0 - (yy + zz),
        xy - wz,
        xz + wy,
        xy + wz,
        1.0 - (xx + zz),
        yz - wx,
        xz - wy,
        yz + wx,
        1.0 - (xx + yy),
    )


@compilable
def yaw_of(R: Axes) -> float:
    """ZYX yaw of a rotation [rad]."""
    return math.atan2(R[3], R[0])


@compilable
def euler_zyx(R: Axes) -> Vec3:
    """Roll, pitch and yaw of a rotation [rad]."""
    return math.atan2(R[7], R[8]), -math.asin(clamp_magnitude(R[6], 1.0)), yaw_of(R)


def quaternion_from_matrix(R: Mat3) -> Vec4:
    """Unit quaternion [w, x, y, z] with w >= 0 (Shepperd's method, largest component first)."""
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = R
    trace = m00 + m11 + m22
    if trace > max(m00, m11, m22):
        w = 0.5 * math.sqrt(1.0 + trace)
        k = 0.25 / w
        return w, (m21 - m12) * k, (m02 - m20) * k, (m10 - m01) * k
    if m00 >= m11 and m00 >= m22:
        x = 0.5 * math.sqrt(1.0 + m00 - m11 - m22)
        k = 0.25 / x
        q = ((m21 - m12) * k, x, (m01 + m10) * k, (m02 + m20) * k)
    elif m11 >= m22:
        y = 0.5 * math.sqrt(1.0 - m00 + m11 - m22)
        k = 0.25 / y
        q = ((m02 - m20) * k, (m01 + m10) * k, y, (m12 + m21) * k)
    else:
        z = 0.5 * math.sqrt(1.0 - m00 - m11 + m22)
        k = 0.25 / z
        q = ((m10 - m01) * k, (m02 + m20) * k, (m12 + m21) * k, z)
    return q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])


def quaternion_from_euler(euler: Vec3) -> Vec4:
    """Quaternion [w, x, y, z], body to NED, of ZYX Euler angles ``euler`` [rad, NED to body]."""
    cr, cp, cy = (math.cos(0.5 * angle) for angle in euler)
    sr, sp, sy = (math.sin(0.5 * angle) for angle in euler)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@compilable
def nine(a: tuple[float, ...] | Floats, at: int) -> Mat3:
    """The matrix in ``a`` (n,) [any unit], row by row, that begins ``at`` [1]."""
    return (
        *(a[at], a[at + 1], a[at + 2]),
        *(a[at + 3], a[at + 4], a[at + 5]),
        *(a[at + 6], a[at + 7], a[at + 8]),
    )


@compilable
def rotate(R: Axes, v: Vec3) -> Vec3:
    """World components of ``v`` [any unit, FRD]."""
    x, y, z = v
    return (
        R[0] * x + R[1] * y + R[2] * z,
        R[3] * x + R[4] * y + R[5] * z,
        R[6] * x + R[7] * y + R[8] * z,
    )


@compilable
def rotate_back(R: Axes, v: Vector) -> Vec3:
    """Body components of ``v`` [any unit, NED]."""
    x, y, z = v[0], v[1], v[2]
    return (
        R[0] * x + R[3] * y + R[6] * z,
        R[1] * x + R[4] * y + R[7] * z,
        R[2] * x + R[5] * y + R[8] * z,
    )


@compilable
def wrap_angle(angle: float) -> float:
    """The same ``angle`` [rad] within -pi..pi, pi excluded."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
