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
from fsw.signals import PredictionState, StateEstimate, Vec2, Vec3, Vec4


@dataclass(frozen=True, slots=True)
class CompensationLimits:
    """How far the arm may leave its planned pose to compensate."""

    reach: float = 0.985  # of the straight arm; beyond it the elbow loses its side
    fold: float = 0.25  # of the straight arm; closer to the base it folds through itself
    joint_margin: float = 0.03  # rad, kept to the joint limits
    # How far the end-effector is moved against its planned place in the base's frame. Every
    # correction pushes off the base, and an arm that follows the worst disturbance in full needs
    # the pitch torque with which the base rejects it.
    whole: float = 0.02  # m, corrected wholly up to here
    most: float = 0.04  # m, and never further than this
    # What the base was off its plan by lately: it is compensated wholly up to ``near``, and not at
    # all from ``far``, where the base needs its pitch torque for itself.
    near: float = 0.035  # m
    far: float = 0.055  # m
    memory: float = 2.0  # s, in which a deviation is forgotten


@compilable
def planned_end_effector(airframe: Airframe, plan: PredictionState) -> tuple[Vec3, Vec3]:
    """World position and velocity of the end-effector in the plan's state."""
    points = np.empty((2, 2, 3))
    arm_points(to_vector(plan), airframe.link_length[0], airframe.link_length[1], points)
    p, v = points[END_EFFECTOR, 0], points[END_EFFECTOR, 1]
    return (float(p[0]), float(p[1]), float(p[2])), (float(v[0]), float(v[1]), float(v[2]))


@compilable
def lately_off_plan(
    limits: CompensationLimits,
    before: float,
    estimate: StateEstimate,
    plan: PredictionState,
    dt: float,
) -> float:
    """Largest recent distance [m] of the base from its plan, given that of a tick ``before`` [m].

    ``dt`` [s] is the tick's length.
    """
    kept = before * (1.0 - min(dt / limits.memory, 1.0))
    return max(norm(subtract(plan.p, estimate.p_WB)), kept)


@compilable
def compensated_joints(
    airframe: Airframe,
    limits: CompensationLimits,
    off_plan: float,
    estimate: StateEstimate,
    plan: PredictionState,
) -> tuple[Vec2, Vec2]:
    """Joint angles [rad] and rates [rad/s] that keep the end-effector on its planned path.

    The elbow of the plan, where bent, decides on which side ours is. ``off_plan`` [m] is how far
    the base was off its plan lately.
    """
    l1, l2 = airframe.link_length[0], airframe.link_length[1]
    p_WE, v_WE = planned_end_effector(airframe, plan)
    x, z, vx, vz = _seen_from_base(estimate, p_WE, v_WE)
    x, z, vx, vz = _within_correction(airframe, limits, off_plan, plan, (x, z, vx, vz))
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
def _within_correction(
    airframe: Airframe,
    limits: CompensationLimits,
    off_plan: float,
    plan: PredictionState,
    seen: Vec4,
) -> Vec4:
    """The point, and how it moves, no further from the planned one than the correction reaches."""
    th1, w1 = plan.q_arm[0], plan.qd_arm[0]
    th12, w12 = th1 + plan.q_arm[1], w1 + plan.qd_arm[1]
    (x1, z1), (x2, z2) = links(airframe.link_length, th1, th12)
    x, z, vx, vz = x1 + x2, z1 + z2, z1 * w1 + z2 * w12, -x1 * w1 - x2 * w12
    dx, dz, dvx, dvz = seen[0] - x, seen[1] - z, seen[2] - vx, seen[3] - vz
    far = math.hypot(dx, dz)
    calm = clamp((limits.far - off_plan) / max(limits.far - limits.near, 1e-6), 0.0, 1.0)
    share, slope = calm, calm
    if far > limits.whole:
        span = max(limits.most - limits.whole, 1e-6)
        bend = math.tanh((far - limits.whole) / span)
        share = calm * (limits.whole + span * bend) / far
        slope = calm * (1.0 - bend * bend)
    # Outwards the point slows down by the slope, along the circle by the share.
    outwards = (slope - share) * (dx * dvx + dz * dvz) / max(far * far, 1e-12)
    return (
        x + share * dx,
        z + share * dz,
        vx + share * dvx + outwards * dx,
        vz + share * dvz + outwards * dz,
    )


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
