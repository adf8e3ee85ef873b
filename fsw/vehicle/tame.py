"""A streamed trajectory, as far as it may pull: the planner's barriers have a price.

What is asked for near the vehicle's own motion, and not far behind a wall, passes as it is: the
paper's own path enters the safety zone. Farther out the pull on the planner could outbid the
prices of barrier rows and joint limits (docs/decisions/0010-steering-through-the-planner.md).
"""

from __future__ import annotations

import math

from fsw.barriers.safe_approach import safe_approach_speed
from fsw.barriers.tangent import planes
from fsw.signals import EndEffectorTarget, SafeSet, Vec3, Wall

_LEASH = 0.4  # m from where the end-effector's motion leads to the target, now
_SPREAD = 0.4  # m/s, by which that grows over the horizon
_JUMP = 1.0  # m/s between the end-effector and its target; more makes the planned arm wind up
_DEPTH = 0.1  # m behind the clearance; the paper's path goes 0.03 m deep
_ALWAYS = 0.5  # m/s towards a wall, half of what the price of a row stands


def tamed(
    targets: tuple[EndEffectorTarget, ...],
    p_WE: Vec3,
    v_WE: Vec3,
    safe_set: SafeSet,
    braking: float,
    slope: float,
) -> tuple[EndEffectorTarget, ...]:
    """The targets of a horizon, the same object where they ask for nothing wild.

    Args:
        targets: At the nodes.
        p_WE: Where the end-effector is [m].
        v_WE: How it moves [m/s].
        safe_set: Its walls and obstacles are looked at.
        braking: Deceleration the barrier counts on [m/s^2].
        slope: Of S at the boundary [1/s].
    """
    begin_us, kept = targets[0].t_us, []
    approached = [
        (wall.normal, _fastest(wall, p_WE, braking, slope)) for wall in planes(safe_set, p_WE)
    ]
    for target in targets:
        ahead = 1e-6 * (target.t_us - begin_us)
        p = _within(target.p_WE, _plus(p_WE, v_WE, ahead), _LEASH + _SPREAD * ahead)
        v = _within(target.v_WE, v_WE, _JUMP)
        for wall in planes(safe_set, p):
            depth = wall.offset + wall.clearance - _dot(wall.normal, p)
            if depth > _DEPTH:
                p = _plus(p, wall.normal, depth - _DEPTH)
        for n, most in approached:
            approach = -_dot(n, v)
            if approach > most:
                v = _plus(v, n, approach - most)
        kept.append(EndEffectorTarget(target.t_us, p, v, target.a_WE, target.yaw))
    tame = tuple(kept)
    return targets if tame == targets else tame


def _fastest(wall: Wall, p_WE: Vec3, braking: float, slope: float) -> float:
    """How fast to approach a wall [m/s]."""
    room = max(_dot(wall.normal, p_WE) - (wall.offset + wall.clearance), 0.0)
    return max(safe_approach_speed(room, braking, slope), _ALWAYS)


def _within(a: Vec3, centre: Vec3, radius: float) -> Vec3:
    """The point, or the nearest one of a ball."""
    away = (a[0] - centre[0], a[1] - centre[1], a[2] - centre[2])
    length = math.sqrt(_dot(away, away))
    return a if length <= radius else _plus(centre, away, radius / length)


def _plus(a: Vec3, b: Vec3, share: float) -> Vec3:
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


def _dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
