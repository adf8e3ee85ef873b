r"""The arm holds the end-effector where the plan wants it while the base is pushed about.

The base cannot be held better than its tilting allows: under the disturbance it wanders by
centimetres, and every correction swings whatever hangs below. The arm is ten times as
quick. Each tick it is asked for the joint angles that put the end-effector, seen from where
the base really is, on its planned path, as far as its joints can: of an arm in a plane, not across
it. With e what is left and J the end-effector's Jacobian in the arm's coordinates c, a few steps of

.. math:: \min_{\delta c} |J \delta c - e|^2 + (\epsilon^2 + |e|^2) |\delta c|^2
          + \sum_k \max(-e^T \partial_k J_k, 0) \delta c_k^2
          + \sum_k s_k (c_k + \delta c_k - c^*_k)^2

within the bounds of c from the plan's pose c* find them, on its side of every singularity. A
coordinate may swing a joint behind it farther than the end-effector, as that of a turntable above
a folded arm does: s is by how much the largest square of such a motion is beyond that of J_k, and
no coordinate alone moves a joint farther than the end-effector is to go. The rates are those at
which this pose moves, from the same problem.

Source: docs/equations.md T3; J. Nocedal, S. Wright, Numerical Optimization, 2006, ch. 10 (damping
by the residual) and 16.7 (bounds).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from fsw.autopilot.control.joint_reference import JointReferenceLimits
from fsw.autopilot.geometry.rotation import rotate, rotate_back
from fsw.autopilot.geometry.vectors import (
    add,
    add_scaled,
    clamp,
    cross,
    dot,
    norm,
    put_three,
    subtract,
    three,
)
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.arm_coordinates import ArmCoordinates, bounds_of, to_coordinates, to_joints
from fsw.autopilot.model.multibody import (
    Bodies,
    factorise,
    lever_of,
    place_links,
    place_of_tip,
    solve,
)
from fsw.autopilot.signals import Mat3, Vec3
from fsw.autopilot.tick_record import AnyEstimate, AnyPlan, ArmTask
from fsw.compiled import compilable
from fsw.record import JOINTS, Floats

_STEPS: Final = 3  # 20 mm that the base is off are then corrected to a micrometre
_LONGEST: Final = 0.3  # rad a step; the Jacobian is that of no other pose
_DAMPING: Final = 0.003  # m a rad, of a motion that the arm can make; it bounds rates near straight
_ALIGNED: Final = 0.001  # m a rad, with which a joint still moves the end-effector some way
_ROUNDING: Final = 1e-9  # rad
_SWEEPS: Final = 20  # of coordinates at bounds


@dataclass(frozen=True, slots=True)
class CompensationLimits:
    """How far the arm may leave its planned pose to compensate."""

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
def lately_off_plan(
    limits: CompensationLimits, before: float, estimate: AnyEstimate, plan: AnyPlan, dt: float
) -> float:
    """Largest recent distance [m] of the base from its plan, given that of a tick ``before`` [m].

    ``dt`` [s] is the tick's length.
    """
    kept = before * (1.0 - min(dt / limits.memory, 1.0))
    return max(norm(subtract(plan.p, estimate.p_WB)), kept)


@compilable
def compensate(
    a: ArmTask,
    bodies: Bodies,
    arm: ArmCoordinates,
    limits: CompensationLimits,
    joint_limits: JointReferenceLimits,
    off_plan: float,
    estimate: AnyEstimate,
    plan: AnyPlan,
) -> None:
    """Joint angles and rates that keep the end-effector on its planned path. Writes a.q, a.qd.

    ``off_plan`` [m] is how far the base was off its plan lately.
    """
    n = int(arm.joints)
    for i in range(n):
        a.q[i], a.qd[i] = plan.q_arm[i], plan.qd_arm[i]
    to_coordinates(arm, a.q, a.c)
    to_coordinates(arm, a.qd, a.rate)
    _reach(a, bodies, arm)
    for i in range(n):
        a.goal[i], a.swung[i] = a.c[i], _swing(a, arm, i)
    planned, moving = (a.tip[0], a.tip[1], a.tip[2]), _moved(a, a.rate, n)
    off, drifting = _seen_from_base(estimate, plan, planned, moving)
    _align(a, n)
    off, drifting = _reachable(a, n, off), _reachable(a, n, drifting)
    off, drifting = _within_correction(limits, off_plan, off, drifting)
    goal, wanted = add(planned, off), add(moving, drifting)
    left = off
    for step in range(_STEPS):
        if step > 0:
            _reach(a, bodies, arm)
        left = subtract(goal, (a.tip[0], a.tip[1], a.tip[2]))
        for i in range(n):
            low, high = bounds_of(arm, i, joint_limits.margin)
            a.low[i] = clamp(low - a.c[i], -_LONGEST, _LONGEST)
            a.high[i] = clamp(high - a.c[i], -_LONGEST, _LONGEST)
            a.slope[i] = a.swung[i] * (a.goal[i] - a.c[i])
        _damp(a, n, left)
        _solve_within(a, n, left)
        for i in range(n):
            a.c[i] += a.step[i]
        to_joints(arm, a.c, a.q)
    # The last step is short: what moves the end-effector is still what it was before it.
    for i in range(n):
        low, high = bounds_of(arm, i, joint_limits.margin)
        held = a.c[i] <= low + _ROUNDING or a.c[i] >= high - _ROUNDING
        a.low[i] = -a.rate[i] if held else -math.inf
        a.high[i] = -a.rate[i] if held else math.inf
        a.slope[i] = 0.0
    _solve_within(a, n, subtract(wanted, _moved(a, a.rate, n)))
    for i in range(n):
        a.rate[i] += a.step[i]
    to_joints(arm, a.rate, a.qd)


@compilable
def planned_axes(plan: AnyPlan) -> tuple[Mat3, Vec3]:
    """The base's attitude R_WB in the plan's state, and its rate [rad/s, B].

    What ``body_axes`` says, of real numbers and without arrays.
    """
    # Thrust is along f = g e3 - a; b1 is across it and across an axis h that turns
    f: Vec3 = (-plan.a[0], -plan.a[1], GRAVITY - plan.a[2])
    size, c, s = norm(f), math.cos(plan.yaw), math.sin(plan.yaw)
    b3 = (f[0] / size, f[1] / size, f[2] / size)
    turned = cross(b3, (-plan.j[0] / size, -plan.j[1] / size, 0.0))
    h, dh = (-s, c, 0.0), (-c * plan.yaw_rate, -s * plan.yaw_rate, 0.0)
    n = cross(h, b3)
    dn, long = add(cross(dh, b3), cross(h, cross(turned, b3))), norm(n)
    b1 = (n[0] / long, n[1] / long, n[2] / long)
    b2 = cross(b3, b1)
    R = (b1[0], b2[0], b3[0], b1[1], b2[1], b3[1], b1[2], b2[2], b3[2])
    return R, (dot(turned, b1), dot(turned, b2), dot(dn, b2) / long)


@compilable
def _seen_from_base(
    estimate: AnyEstimate, plan: AnyPlan, planned: Vec3, moving: Vec3
) -> tuple[Vec3, Vec3]:
    """By how much the end-effector's place and motion in B differ from those ``planned`` in B.

    Seen from where the base really is, and turning as it really does.
    """
    R, w = planned_axes(plan)
    p = add(rotate(R, planned), subtract(plan.p, estimate.p_WB))
    v = add(rotate(R, add(moving, cross(w, planned))), subtract(plan.v, estimate.v_WB))
    seen, rate = rotate_back(estimate.R_WB, p), estimate.w_WB_B
    turned = cross((rate[0], rate[1], rate[2]), seen)
    return subtract(seen, planned), subtract(
        subtract(rotate_back(estimate.R_WB, v), turned), moving
    )


@compilable
def _reach(a: ArmTask, b: Bodies, arm: ArmCoordinates) -> None:
    """Where the end-effector is at a.q, and its Jacobian.

    Writes rotation, origin, axis, tip, jacobian.
    """
    place_links(a, b, a.q)
    tip, n = place_of_tip(a, b), int(b.joints)
    put_three(a.tip, 0, tip)
    # Of joints, and from the last on of coordinates.
    for k in range(n - 1, -1, -1):
        moved = lever_of(a, k, tip)
        for i in range(k + 1, n):
            moved = add_scaled(moved, three(a.jacobian, 3 * i), -arm.row[JOINTS * i + k])
        for i in range(3):
            a.jacobian[3 * k + i] = moved[i] / arm.row[JOINTS * k + k]


@compilable
def _swing(a: ArmTask, arm: ArmCoordinates, k: int) -> float:
    """How much farther coordinate ``k`` moves a joint than the end-effector [m^2/rad^2]."""
    w: Vec3 = (0.0, 0.0, 0.0)
    v: Vec3 = (0.0, 0.0, 0.0)
    n, farthest = int(arm.joints), 0.0
    for i in range(k, n):
        w = add_scaled(w, three(a.axis, 3 * i), arm.column[JOINTS * k + i])
        behind = (a.tip[0], a.tip[1], a.tip[2])
        if i < n - 1:
            behind = three(a.origin, 3 * i + 3)
        v = add(v, cross(w, subtract(behind, three(a.origin, 3 * i))))
        farthest = max(farthest, dot(v, v))
    return farthest - dot(v, v)


@compilable
def _moved(a: ArmTask, change: Floats, n: int) -> Vec3:
    """What a change of the coordinates (j,) [rad] does to the end-effector [m, B], or a rate."""
    total: Vec3 = (0.0, 0.0, 0.0)
    for k in range(n):
        total = add_scaled(total, three(a.jacobian, 3 * k), change[k])
    return total


@compilable
def _align(a: ArmTask, n: int) -> None:
    """Prepare ``_reachable``. Reads jacobian; writes factor."""
    _set_up(a, n)
    for i in range(n):
        a.gram[JOINTS * i + i] += _ALIGNED * _ALIGNED
    factorise(a.factor, a.gram, n)


@compilable
def _reachable(a: ArmTask, n: int, off: Vec3) -> Vec3:
    """The part of a displacement of the end-effector, or of its rate, that joints can make."""
    for i in range(n):
        a.step[i] = dot(three(a.jacobian, 3 * i), off)
    solve(a.factor, a.step, n)
    return _moved(a, a.step, n)


@compilable
def _set_up(a: ArmTask, n: int) -> None:
    """The products of the Jacobian's columns. Writes gram."""
    for i in range(n):
        one = three(a.jacobian, 3 * i)
        for k in range(i + 1):
            a.gram[JOINTS * i + k] = a.gram[JOINTS * k + i] = dot(one, three(a.jacobian, 3 * k))


@compilable
def _damp(a: ArmTask, n: int, left: Vec3) -> None:
    """Prepare ``_solve_within``. Reads axis, jacobian, swung; writes gram, factor.

    What is ``left`` [m, B] to the end-effector's place damps, most where a turn bends the way from
    it.
    """
    _set_up(a, n)
    for i in range(n):
        bend = -dot(left, cross(three(a.axis, 3 * i), three(a.jacobian, 3 * i)))
        damping = _DAMPING * _DAMPING + dot(left, left) + max(bend, 0.0)
        a.gram[JOINTS * i + i] += damping + a.swung[i]
    factorise(a.factor, a.gram, n)


@compilable
def _solve_within(a: ArmTask, n: int, off: Vec3) -> None:
    """Changes of the coordinates, within bounds, that move the end-effector by ``off``.

    Reads jacobian, gram, factor, low, high, and of slope what draws back to the plan; writes step.
    """
    for i in range(n):
        a.slope[i] += dot(three(a.jacobian, 3 * i), off)
        a.step[i] = a.slope[i]
    solve(a.factor, a.step, n)
    outside = False
    for i in range(n):
        inside = clamp(a.step[i], a.low[i], a.high[i])
        outside = outside or inside != a.step[i]
        a.step[i] = inside
    if not outside:
        return
    for _ in range(_SWEEPS):
        for i in range(n):
            left = a.slope[i]
            for k in range(n):
                left -= a.gram[JOINTS * i + k] * a.step[k]
            a.step[i] = clamp(a.step[i] + left / a.gram[JOINTS * i + i], a.low[i], a.high[i])


@compilable
def _within_correction(
    limits: CompensationLimits, off_plan: float, off: Vec3, drifting: Vec3
) -> tuple[Vec3, Vec3]:
    """What of a displacement, and of how it changes, the correction makes up for."""
    far = norm(off)
    calm = clamp((limits.far - off_plan) / max(limits.far - limits.near, 1e-6), 0.0, 1.0)
    share, slope = calm, calm
    if far > limits.whole:
        span = max(limits.most - limits.whole, 1e-6)
        bend = math.tanh((far - limits.whole) / span)
        share = calm * (limits.whole + span * bend) / far
        slope = calm * (1.0 - bend * bend)
    # Outwards the point slows down by the slope, along the circle by the share.
    outwards = (slope - share) * dot(off, drifting) / max(far * far, 1e-12)
    kept = (share * drifting[0], share * drifting[1], share * drifting[2])
    return (share * off[0], share * off[1], share * off[2]), add_scaled(kept, off, outwards)
