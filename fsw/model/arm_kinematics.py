"""Where the arm's points are, in flight (plain floats) and along the horizon (compiled).

In flight the attitude is measured. Along the horizon it follows from the planned
acceleration: thrust points along ``g - a`` and the body's x axis keeps the planned yaw, so
the plan sees how tilting swings the end-effector.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fsw.compiled import compiled
from fsw.geometry.rotation import rotate
from fsw.model.airframe import GRAVITY
from fsw.model.prediction import Q_ARM, QD_ARM, YAW, YAW_RATE, A, J, P, V
from fsw.signals import StateEstimate, Vec2, Vec3

JOINT2, END_EFFECTOR = 0, 1  # rows of arm_points


def _in_body(lengths: Vec2, q_arm: Vec2, qd_arm: Vec2) -> tuple[Vec3, Vec3]:
    """Position and velocity of the tip of links of these lengths in the body frame."""
    th1, th12 = q_arm[0], q_arm[0] + q_arm[1]
    w1, w12 = qd_arm[0], qd_arm[0] + qd_arm[1]
    x1, z1 = lengths[0] * math.sin(th1), lengths[0] * math.cos(th1)
    x2, z2 = lengths[1] * math.sin(th12), lengths[1] * math.cos(th12)
    return (x1 + x2, 0.0, z1 + z2), (z1 * w1 + z2 * w12, 0.0, -x1 * w1 - x2 * w12)


def point_in_flight(estimate: StateEstimate, lengths: Vec2) -> tuple[Vec3, Vec3]:
    """World position and velocity of an arm point of the estimated vehicle.

    Args:
        estimate: The vehicle.
        lengths: Link lengths; ``(l1, l2)`` gives the end-effector, ``(l1, 0)`` joint 2 [m].

    Returns:
        p_WE [m] and v_WE [m/s], each (3,).
    """
    r, rd = _in_body(lengths, estimate.q_arm, estimate.qd_arm)
    wx, wy, wz = estimate.w_WB_B
    turning = (rd[0] + wy * r[2] - wz * r[1], wz * r[0] - wx * r[2], rd[2] + wx * r[1] - wy * r[0])
    offset = rotate(estimate.R_WB, r)
    velocity = rotate(estimate.R_WB, turning)
    p, v = estimate.p_WB, estimate.v_WB
    return (
        (p[0] + offset[0], p[1] + offset[1], p[2] + offset[2]),
        (v[0] + velocity[0], v[1] + velocity[1], v[2] + velocity[2]),
    )


@compiled
def arm_points(x: NDArray[np.generic], l1: float, l2: float, out: NDArray[np.generic]) -> None:
    """World position and velocity of joint 2 and end-effector of a prediction state.

    Written without trigonometry of the tilt and without absolute values, so that it accepts
    complex states: the derivative is then exact (complex step).

    Args:
        x: Prediction state (19,), real or complex.
        l1: Length of link 1 [m].
        l2: Length of link 2 [m].
        out: (2, 2, 3), same type: [joint 2 | end-effector][position | velocity][axis].
    """
    # Thrust along f = g e3 - a; its derivative needs the horizontal jerk only: a vertical
    # jerk changes the length of f, hardly its direction.
    fx, fy, fz = -x[A], -x[A + 1], GRAVITY - x[A + 2]
    dfx, dfy = -x[J], -x[J + 1]
    f = np.sqrt(fx * fx + fy * fy + fz * fz)
    b3x, b3y, b3z = fx / f, fy / f, fz / f
    along = (b3x * dfx + b3y * dfy) / f
    d3x, d3y, d3z = dfx / f - b3x * along, dfy / f - b3y * along, -b3z * along

    # b1 = (heading's left-right axis) x b3, normalised: the ZYX attitude of this yaw.
    c, s = np.cos(x[YAW]), np.sin(x[YAW])
    w = x[YAW_RATE]
    nx, ny, nz = c * b3z, s * b3z, -s * b3y - c * b3x
    dnx = -s * w * b3z + c * d3z
    dny = c * w * b3z + s * d3z
    dnz = -c * w * b3y - s * d3y + s * w * b3x - c * d3x
    n = np.sqrt(nx * nx + ny * ny + nz * nz)
    b1x, b1y, b1z = nx / n, ny / n, nz / n
    along = (b1x * dnx + b1y * dny + b1z * dnz) / n
    d1x, d1y, d1z = dnx / n - b1x * along, dny / n - b1y * along, dnz / n - b1z * along

    th1, th12 = x[Q_ARM], x[Q_ARM] + x[Q_ARM + 1]
    w1, w12 = x[QD_ARM], x[QD_ARM] + x[QD_ARM + 1]
    rx, rz = l1 * np.sin(th1), l1 * np.cos(th1)
    vx, vz = rz * w1, -rx * w1
    for point in range(2):
        if point == 1:
            tx, tz = l2 * np.sin(th12), l2 * np.cos(th12)
            rx, rz, vx, vz = rx + tx, rz + tz, vx + tz * w12, vz - tx * w12
        out[point, 0, 0] = x[P] + rx * b1x + rz * b3x
        out[point, 0, 1] = x[P + 1] + rx * b1y + rz * b3y
        out[point, 0, 2] = x[P + 2] + rx * b1z + rz * b3z
        out[point, 1, 0] = x[V] + vx * b1x + rx * d1x + vz * b3x + rz * d3x
        out[point, 1, 1] = x[V + 1] + vx * b1y + rx * d1y + vz * b3y + rz * d3y
        out[point, 1, 2] = x[V + 2] + vx * b1z + rx * d1z + vz * b3z + rz * d3z
