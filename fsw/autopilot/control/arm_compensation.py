r"""The arm holds the end-effector where the plan wants it while the base is pushed about.

The base cannot be held better than its tilting allows: under the disturbance it wanders by
centimetres, and every correction swings whatever hangs below. The arm is ten times as
quick. Each tick it is asked for the joint angles that put the end-effector, seen from where
the base really is, on its planned path, as far as the arm's plane allows; across the plane it
can do nothing. Where a limit of the joints is in the way it is the pose within them that comes
nearest, and the rates are those at which this pose moves.

Source: docs/equations.md T3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.autopilot.control.joint_reference import JointReferenceLimits, bounds
from fsw.autopilot.geometry.rotation import rotate_back
from fsw.autopilot.geometry.vectors import clamp, clamp_magnitude, norm, subtract
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.kinematics import links, predicted_end_effector
from fsw.autopilot.model.prediction import to_vector
from fsw.autopilot.signals import PredictionState, StateEstimate, Vec2, Vec3, Vec4
from fsw.autopilot.tick_record import Estimate, PlanState
from fsw.compiled import compilable


@dataclass(frozen=True, slots=True)
class CompensationLimits:
    """How far the arm may leave its planned pose to compensate."""

    reach: float = 0.985  # of the straight arm; beyond it the elbow loses its side
    fold: float = 0.25  # of the straight arm; closer to the base it folds through itself
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
def planned_end_effector(
    airframe: Airframe, plan: PredictionState | PlanState
) -> tuple[Vec3, Vec3]:
    """World position and velocity of the end-effector in the plan's state."""
    return predicted_end_effector(airframe.bodies, to_vector(plan, int(airframe.bodies.joints)))


@compilable
def lately_off_plan(
    limits: CompensationLimits,
    before: float,
    estimate: StateEstimate | Estimate,
    plan: PredictionState | PlanState,
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
    joint_limits: JointReferenceLimits,
    off_plan: float,
    estimate: StateEstimate | Estimate,
    plan: PredictionState | PlanState,
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
        return (plan.q_arm[0], plan.q_arm[1]), (plan.qd_arm[0], plan.qd_arm[1])
    # A plan that is nearly straight has no side; the arm then stays on the one it is on.
    side = plan.q_arm[1] if abs(plan.q_arm[1]) >= _LEAST_BEND else estimate.q_arm[1]
    straight = l1 + l2
    scale = clamp(length, limits.fold * straight, limits.reach * straight) / length
    if scale != 1.0:  # the arm cannot follow in or out, only round
        outwards = (vx * x + vz * z) / (length * length)
        vx, vz = scale * (vx - outwards * x), scale * (vz - outwards * z)
    x, z = x * scale, z * scale
    cos2 = (x * x + z * z - l1 * l1 - l2 * l2) / (2.0 * l1 * l2)
    th2 = math.copysign(math.acos(clamp_magnitude(cos2, 1.0)), side)
    th1 = math.atan2(x, z) - math.atan2(l2 * math.sin(th2), l1 + l2 * math.cos(th2))
    first, both = bounds(airframe, joint_limits)
    if abs(th1) <= first and abs(th1 + th2) <= both:
        return (th1, th2), _rates(airframe, th1, th1 + th2, vx, vz)
    return _nearest_pose(airframe, (first, both), (th1, th1 + th2), (x, z), (vx, vz))


_LEAST_BEND = 0.2  # rad; a straighter plan has no side


@compilable
def _within_correction(
    airframe: Airframe,
    limits: CompensationLimits,
    off_plan: float,
    plan: PredictionState | PlanState,
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
    estimate: StateEstimate | Estimate, p_WE: Vec3, v_WE: Vec3
) -> tuple[float, float, float, float]:
    """Where the point is in the arm's plane of the real body, and how it moves there."""
    R = estimate.R_WB
    x, y, z = rotate_back(R, subtract(p_WE, estimate.p_WB))
    ux, _, uz = rotate_back(R, subtract(v_WE, estimate.v_WB))
    wx, wy, wz = estimate.w_WB_B[0], estimate.w_WB_B[1], estimate.w_WB_B[2]
    vx = ux - (wy * z - wz * y)
    vz = uz - (wx * y - wy * x)
    return x, z, vx, vz


@compilable
def _nearest_pose(
    airframe: Airframe, most: Vec2, links_wanted: Vec2, p: Vec2, v: Vec2
) -> tuple[Vec2, Vec2]:
    """Joint angles and rates of the pose within ``most`` that brings the end-effector nearest.

    One link stands at its limit and the other points from there, or from the base, at the place.
    """
    l1, l2 = airframe.link_length[0], airframe.link_length[1]
    held1, held12 = (
        clamp_magnitude(links_wanted[0], most[0]),
        clamp_magnitude(links_wanted[1], most[1]),
    )
    th12, w12, miss12 = _pointed(l1, held1, l2, most[1], p, v)
    th1, w1, miss1 = _pointed(l2, held12, l1, most[0], p, v)
    if miss12 <= miss1:
        return (held1, th12 - held1), (0.0, w12)
    return (th1, held12 - th1), (w1, -w1)


@compilable
def _pointed(
    held_length: float, held: float, length: float, bound: float, p: Vec2, v: Vec2
) -> tuple[float, float, float]:
    """Angle and rate of a link that points at a place beside one that is held, and the miss."""
    x, z = p[0] - held_length * math.sin(held), p[1] - held_length * math.cos(held)
    distance = max(math.hypot(x, z), 1e-3)
    free = math.atan2(x, z)
    angle = clamp_magnitude(free, bound)
    rate = (z * v[0] - x * v[1]) / (distance * distance) if angle == free else 0.0
    return angle, rate, math.hypot(x - length * math.sin(angle), z - length * math.cos(angle))


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
