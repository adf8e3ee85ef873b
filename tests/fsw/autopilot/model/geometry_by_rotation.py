"""The arm's points by chained rotations, sharing no line with the flight software."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.prediction import Array

GRAVITY = 9.81


def attitude(a: Array, yaw: float) -> Rotation:
    """ZYX attitude with this yaw whose thrust gives the acceleration ``a`` (3,)."""
    down = np.array([0.0, 0.0, GRAVITY]) - a
    ahead = Rotation.from_euler("Z", -yaw).apply(down / np.linalg.norm(down))
    # Ry(pitch) Rx(roll) e3 = (cos roll sin pitch, -sin roll, cos roll cos pitch).
    roll = -math.asin(ahead[1])
    pitch = math.atan2(ahead[0], ahead[2])
    return Rotation.from_euler("ZYX", [yaw, pitch, roll])


def tips(p: Array, R_WB: Rotation, q_arm: Array, lengths: Array) -> Array:
    """Joint 2 and end-effector in the world (2, 3): every joint turns about +y of the body."""
    link1 = R_WB * Rotation.from_euler("Y", q_arm[0])
    link2 = link1 * Rotation.from_euler("Y", q_arm[1])
    joint2 = p + link1.apply([0.0, 0.0, lengths[0]])
    return np.array([joint2, joint2 + link2.apply([0.0, 0.0, lengths[1]])])


def tips_of_prediction(x: Array, lengths: Array) -> Array:
    """Joint 2 and end-effector (2, 3) of a prediction state (19,)."""
    return tips(x[0:3], attitude(x[6:9], x[13]), x[15::2], lengths)


def moved_on(x: Array, t: float) -> Array:
    """The state a moment later: position to jerk and yaw and joints at constant rates.

    The vertical jerk is zero, as the model assumes.
    """
    later = x.copy()
    jerk = np.array([x[9], x[10], 0.0])
    later[0:3] += t * x[3:6] + t * t / 2.0 * x[6:9] + t**3 / 6.0 * jerk
    later[6:9] += t * jerk
    later[13] += t * x[14]
    later[15::2] += t * x[16::2]
    return later
