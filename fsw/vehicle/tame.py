"""A streamed trajectory, as far as it may pull: the planner's barriers have a price.

What is asked for within a leash of the vehicle, and not far behind a wall, passes as it is: the
paper's own path enters the safety zone. Farther out the pull on the planner could outbid the
price of softening a barrier row (docs/decisions/0010-steering-through-the-planner.md).
"""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.barriers.margins import plain_root
from fsw.signals import EndEffectorTarget, SafeSet, Vec3

_LEASH = 0.5  # m from the vehicle's end-effector to the first target
_DEPTH = 0.1  # m behind the clearance; the paper's path goes 0.03 m deep
_ALWAYS = 0.5  # m/s towards a wall, half of what the price of a row stands


def tamed(
    targets: tuple[EndEffectorTarget, ...],
    p_WE: Vec3,
    safe_set: SafeSet,
    braking: float,
    slope: float,
) -> tuple[EndEffectorTarget, ...]:
    """The targets of a horizon, the same object where they ask for nothing wild.

    Args:
        targets: At the nodes.
        p_WE: Where the end-effector is [m].
        safe_set: Its walls are looked at.
        braking: Deceleration the barrier counts on [m/s^2].
        slope: Of S at the boundary [1/s].
    """
    away = _minus(targets[0].p_WE, p_WE)
    length = math.sqrt(_dot(away, away))
    excess = max(length - _LEASH, 0.0) / length if length > 0.0 else 0.0
    shift = (-excess * away[0], -excess * away[1], -excess * away[2])
    kept = tuple(_tamed(target, shift, p_WE, safe_set, braking, slope) for target in targets)
    return targets if kept == targets else kept


def _tamed(
    target: EndEffectorTarget,
    shift: Vec3,
    p_WE: Vec3,
    safe_set: SafeSet,
    braking: float,
    slope: float,
) -> EndEffectorTarget:
    p, v = _plus(target.p_WE, shift, 1.0), target.v_WE
    for wall in safe_set.walls:
        n, boundary = wall.normal, wall.offset + wall.clearance
        depth = boundary - _dot(n, p)
        if depth > _DEPTH:
            p = _plus(p, n, depth - _DEPTH)
        room = max(_dot(n, p_WE) - boundary, 0.0)
        most = max(plain_root(room, braking, slope), _ALWAYS)
        approach = -_dot(n, v)
        if approach > most:
            v = _plus(v, n, approach - most)
    return replace(target, p_WE=p, v_WE=v)


def _plus(a: Vec3, b: Vec3, share: float) -> Vec3:
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


def _minus(a: Vec3, b: Vec3) -> Vec3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
