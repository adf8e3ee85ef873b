"""Forward kinematics of the arm: every place where angles become positions.

The arm moves in the x-z plane of the body: th1 counts from straight down (body z), th2 is relative
to link 1. In flight the attitude is measured (``point_in_flight``). Along the horizon it follows
from the planned acceleration: thrust points along ``g - a`` and the body's x axis keeps the planned
yaw, so the plan includes how tilting swings the end-effector (``arm_points``).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.geometry.rotation import rotate
from fsw.autopilot.geometry.vectors import add_scaled
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.prediction import Q_ARM, QD_ARM, YAW, YAW_RATE, A, J, P, V
from fsw.autopilot.signals import JointVector, StateEstimate, Vec2, Vec3
from fsw.compiled import compilable, compiled

JOINT2, END_EFFECTOR = 0, 1  # rows of arm_points


@compilable
def _link(length: Any, sine: Any, cosine: Any, rate: Any) -> Any:
    """One link in the arm's plane: forward, down [m] and their rates [m/s].

    The angle enters by its sine and cosine, so that the numbers may be real, complex (the
    derivatives of the horizon) or symbolic (a study's reference).
    """
    x, z = length * sine, length * cosine
    return x, z, z * rate, -x * rate


@compilable
def links(lengths: Vec2, th1: float, th12: float) -> tuple[Vec2, Vec2]:
    """Both links as vectors (forward, down) in the body's x-z plane [m].

    Links of ``lengths`` [m], from straight down ``th1`` [rad] and ``th12`` [rad].
    """
    x1, z1, _, _ = _link(lengths[0], math.sin(th1), math.cos(th1), 0.0)
    x2, z2, _, _ = _link(lengths[1], math.sin(th12), math.cos(th12), 0.0)
    return (x1, z1), (x2, z2)


def end_effector_when_level(lengths: Vec2, q_arm: JointVector, yaw: float) -> Vec3:
    """From the body origin to the end-effector of a level vehicle [m, NED].

    Links of ``lengths`` [m], joints at ``q_arm`` [rad], the body at ``yaw`` [rad].
    """
    (x1, z1), (x2, z2) = links(lengths, q_arm[0], q_arm[0] + q_arm[1])
    ahead = x1 + x2
    return ahead * math.cos(yaw), ahead * math.sin(yaw), z1 + z2


def _tip_in_body(lengths: Vec2, q_arm: JointVector, qd_arm: JointVector) -> tuple[Vec3, Vec3]:
    """Position [m] and velocity [m/s] of the tip of links of these lengths in the body frame."""
    th1, th12 = q_arm[0], q_arm[0] + q_arm[1]
    x1, z1, vx1, vz1 = _link(lengths[0], math.sin(th1), math.cos(th1), qd_arm[0])
    w12 = qd_arm[0] + qd_arm[1]
    x2, z2, vx2, vz2 = _link(lengths[1], math.sin(th12), math.cos(th12), w12)
    return (x1 + x2, 0.0, z1 + z2), (vx1 + vx2, 0.0, vz1 + vz2)


def point_in_flight(estimate: StateEstimate, lengths: Vec2) -> tuple[Vec3, Vec3]:
    """World position p_WE [m] and velocity v_WE [m/s] of an arm point of the estimated vehicle.

    Link ``lengths`` [m]: ``(l1, l2)`` gives the end-effector, ``(l1, 0)`` joint 2.
    """
    r, rd = _tip_in_body(lengths, estimate.q_arm, estimate.qd_arm)
    wx, wy, wz = estimate.w_WB_B
    turning = (rd[0] + wy * r[2] - wz * r[1], wz * r[0] - wx * r[2], rd[2] + wx * r[1] - wy * r[0])
    offset, velocity = rotate(estimate.R_WB, r), rotate(estimate.R_WB, turning)
    return add_scaled(estimate.p_WB, offset, 1.0), add_scaled(estimate.v_WB, velocity, 1.0)


@compiled
def body_axes(x: NDArray[np.generic], out: NDArray[np.generic]) -> None:
    """The body's x and z axes of a prediction state, and how fast they turn.

    Written without trigonometry of the tilt and without absolute values, so that it accepts a
    complex state ``x`` (19,) [SI]: the derivative is then exact (complex step). Into
    ``out`` (4, 3) [1, 1/s] go b1, b3 and their rates, in NED.
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
    out[0, 0], out[0, 1], out[0, 2] = b1x, b1y, b1z
    out[1, 0], out[1, 1], out[1, 2] = b3x, b3y, b3z
    out[2, 0] = dnx / n - b1x * along
    out[2, 1] = dny / n - b1y * along
    out[2, 2] = dnz / n - b1z * along
    out[3, 0], out[3, 1], out[3, 2] = d3x, d3y, d3z


@compiled
def arm_points(x: NDArray[np.float64], l1: float, l2: float, out: NDArray[np.float64]) -> None:
    """World position and velocity of joint 2 and end-effector of a prediction state.

    The state ``x`` is (19,) [SI], links are of ``l1`` [m] and ``l2`` [m]. Into
    ``out`` (2, 2, 3) [m, m/s] go, in NED, [joint 2 | end-effector][position | velocity].
    """
    axes = np.empty((4, 3))
    body_axes(x, axes)
    b1, b3, d1, d3 = axes
    th1, th12 = x[Q_ARM], x[Q_ARM] + x[Q_ARM + 1]
    w1, w12 = x[QD_ARM], x[QD_ARM] + x[QD_ARM + 1]
    rx, rz, vx, vz = _link(l1, np.sin(th1), np.cos(th1), w1)
    for point in range(2):
        if point == 1:
            tx, tz, ux, uz = _link(l2, np.sin(th12), np.cos(th12), w12)
            rx, rz, vx, vz = rx + tx, rz + tz, vx + ux, vz + uz
        for k in range(3):
            out[point, 0, k] = x[P + k] + rx * b1[k] + rz * b3[k]
            out[point, 1, k] = x[V + k] + vx * b1[k] + rx * d1[k] + vz * b3[k] + rz * d3[k]
