"""A state that is moved on by its own rates, where no sensor frame came or not all of one."""

from __future__ import annotations

import math

from fsw.autopilot.geometry.rotation import rotate, yaw_of
from fsw.autopilot.geometry.vectors import add_scaled, norm
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.signals import Mat3, StateEstimate, Vec3


def moved_on(x: StateEstimate, seconds: float, felt: Vec3 | None = None) -> StateEstimate:
    """The estimate a few ``seconds`` [s] later: the specific force and all rates are held.

    The force is the estimate's, which is along one axis alone, or that ``felt`` [m/s^2, FRD].
    """
    t, R = seconds, x.R_WB
    if felt is None:
        a = (-x.specific_force * R[2], -x.specific_force * R[5], GRAVITY - x.specific_force * R[8])
    else:
        a = add_scaled(rotate(R, felt), (0.0, 0.0, 1.0), GRAVITY)
    turned = _turned(R, (t * x.w_WB_B[0], t * x.w_WB_B[1], t * x.w_WB_B[2]))
    return x._replace(
        p_WB=add_scaled(x.p_WB, add_scaled(x.v_WB, a, 0.5 * t), t),
        v_WB=add_scaled(x.v_WB, a, t),
        R_WB=turned,
        yaw=yaw_of(turned),
        q_arm=tuple([q + t * qd for q, qd in zip(x.q_arm, x.qd_arm, strict=True)]),
    )


def _turned(R: Mat3, angle: Vec3) -> Mat3:
    """R times the rotation by a small vector in body components (Rodrigues)."""
    x, y, z = angle
    size = norm(angle)
    if size < 1e-12:
        return R
    s, c = math.sin(size) / size, (1.0 - math.cos(size)) / (size * size)
    first = rotate(R, (1.0 - c * (y * y + z * z), s * z + c * x * y, -s * y + c * x * z))
    second = rotate(R, (-s * z + c * x * y, 1.0 - c * (x * x + z * z), s * x + c * y * z))
    third = rotate(R, (s * y + c * x * z, -s * x + c * y * z, 1.0 - c * (x * x + y * y)))
    return (
        first[0], second[0], third[0],
        first[1], second[1], third[1],
        first[2], second[2], third[2],
    )  # fmt: skip
