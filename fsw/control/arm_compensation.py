r"""The arm holds the end-effector where the plan wants it while the base is pushed about.

The base cannot be held better than its tilting allows: under the disturbance it wanders by
centimetres, and every correction swings whatever hangs below. The arm is ten times as
quick. Each tick it is asked for the joint angles that put the end-effector, seen from where
the base really is, on its planned path, as far as the arm's plane and its limits allow;
across the plane it can do nothing.

Source: docs/equations.md T3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fsw.compiled import compilable
from fsw.geometry.rotation import rotate_back
from fsw.geometry.vectors import clamp, clamp_magnitude, norm, subtract
from fsw.model.airframe import Airframe
from fsw.model.kinematics import END_EFFECTOR, arm_points, links
from fsw.model.prediction import to_vector
from fsw.signals import PredictionState, StateEstimate, Vec2, Vec3


@dataclass(frozen=True, slots=True)
class CompensationLimits:
    """How far the arm may leave its planned pose to compensate."""

    reach: float = 0.985  # of the straight arm; beyond it the elbow loses its side
    fold: float = 0.25  # of the straight arm; closer to the base it folds through itself
    joint_margin: float = 0.03  # rad, kept to the joint limits
    # Off its plan by more than any disturbance makes it, the vehicle needs its rotors' torque for
    # itself: an arm that chases a far point slings it about.
    whole: float = 0.07  # m, compensates wholly up to here
    none: float = 0.12  # m, and not at all from here


@compilable
def planned_end_effector(airframe: Airframe, plan: PredictionState) -> tuple[Vec3, Vec3]:
    """World position and velocity of the end-effector in the plan's state."""
    points = np.empty((2, 2, 3))
    arm_points(to_vector(plan), airframe.link_length[0], airframe.link_length[1], points)
    p, v = points[END_EFFECTOR, 0], points[END_EFFECTOR, 1]
    return (float(p[0]), float(p[1]), float(p[2])), (float(v[0]), float(v[1]), float(v[2]))


@compilable
def compensated_joints(
    airframe: Airframe,
    limits: CompensationLimits,
    estimate: StateEstimate,
    plan: PredictionState,
) -> tuple[Vec2, Vec2]:
    """Joint angles [rad] and rates [rad/s] that keep the end-effector on its planned path.

    The elbow of the plan, where bent, decides on which side ours is.
    """
    l1, l2 = airframe.link_length[0], airframe.link_length[1]
    p_WE, v_WE = planned_end_effector(airframe, plan)
    x, z, vx, vz = _seen_from_base(estimate, p_WE, v_WE)
    off_plan = norm(subtract(plan.p, estimate.p_WB))
    share = clamp((limits.none - off_plan) / (limits.none - limits.whole), 0.0, 1.0)
    if share < 1.0:
        th1 = plan.q_arm[0]
        (x1, z1), (x2, z2) = links(airframe.link_length, th1, th1 + plan.q_arm[1])
        x = share * x + (1.0 - share) * (x1 + x2)
        z = share * z + (1.0 - share) * (z1 + z2)
        vx, vz = share * vx, share * vz
    length = math.hypot(x, z)
    if length < 1e-3:
        return plan.q_arm, plan.qd_arm
    # A plan that is nearly straight has no side; the arm then stays on the one it is on.
    side = plan.q_arm[1] if abs(plan.q_arm[1]) >= _LEAST_BEND else estimate.q_arm[1]
    straight = l1 + l2
    scale = clamp(length, limits.fold * straight, limits.reach * straight) / length
    x, z = x * scale, z * scale
    cos2 = (x * x + z * z - l1 * l1 - l2 * l2) / (2.0 * l1 * l2)
    th2 = math.copysign(math.acos(clamp_magnitude(cos2, 1.0)), side)
    th1 = math.atan2(x, z) - math.atan2(l2 * math.sin(th2), l1 + l2 * math.cos(th2))
    th1, th12 = _within_limits(airframe, limits, th1, th1 + th2)
    return (th1, th12 - th1), _rates(airframe, th1, th12, vx, vz)


_LEAST_BEND = 0.2  # rad; a straighter plan has no side


@compilable
def _seen_from_base(
    estimate: StateEstimate, p_WE: Vec3, v_WE: Vec3
) -> tuple[float, float, float, float]:
    """Where the point is in the arm's plane of the real body, and how it moves there."""
    R = estimate.R_WB
    x, y, z = rotate_back(R, subtract(p_WE, estimate.p_WB))
    ux, _, uz = rotate_back(R, subtract(v_WE, estimate.v_WB))
    wx, wy, wz = estimate.w_WB_B
    vx = ux - (wy * z - wz * y)
    vz = uz - (wx * y - wy * x)
    return x, z, vx, vz


@compilable
def _within_limits(airframe: Airframe, limits: CompensationLimits, th1: float, th12: float) -> Vec2:
    bound1 = airframe.joint1_limit - limits.joint_margin
    bound12 = airframe.joint12_limit - limits.joint_margin
    return clamp_magnitude(th1, bound1), clamp_magnitude(th12, bound12)


@compilable
def _rates(airframe: Airframe, th1: float, th12: float, vx: float, vz: float) -> Vec2:
    """Joint rates for a velocity of the end-effector in the body's x-z plane."""
    l1, l2 = airframe.link_length[0], airframe.link_length[1]
    (x1, z1), (x2, z2) = links(airframe.link_length, th1, th12)
    # [vx, vz] = [[z1, z2], [-x1, -x2]] [w1, w12]
    determinant = z2 * x1 - z1 * x2
    if abs(determinant) < 0.1 * l1 * l2:
        return 0.0, 0.0
    w1 = (-x2 * vx - z2 * vz) / determinant
    w12 = (x1 * vx + z1 * vz) / determinant
    return w1, w12 - w1
