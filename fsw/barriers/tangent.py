"""A point obstacle as a wall: the tangent plane of its clearance ball, from where one looks.

An upright obstacle has a cylinder in place of the ball, whose tangent planes are upright.
The half-space in front of that plane lies outside the ball. A point that keeps off the plane, or
stops in front of it, keeps off the obstacle, so the rules for walls apply.

Source: docs/equations.md E11.
"""

from __future__ import annotations

from fsw.geometry.vectors import dot, norm
from fsw.signals import PointObstacle, SafeSet, Vec3, Wall

CENTRE_BALL = 0.002  # m; closer to the obstacle its direction is noise and any does


def distance_to(obstacle: PointObstacle, p: Vec3) -> float:
    """From an obstacle to ``p`` [m, NED], level where the obstacle is upright [m]."""
    return norm(_away(obstacle, p))


def tangent(obstacle: PointObstacle, p: Vec3) -> Wall:
    """The wall that an obstacle is to ``p`` [m, NED]: normal along the ray from the obstacle."""
    x, y, z = away = _away(obstacle, p)
    length = norm(away)
    n = (x / length, y / length, z / length) if length > CENTRE_BALL else (1.0, 0.0, 0.0)
    return Wall(n, dot(n, obstacle.position), obstacle.clearance)


def _away(obstacle: PointObstacle, p: Vec3) -> Vec3:
    o = obstacle.position
    return p[0] - o[0], p[1] - o[1], 0.0 if obstacle.upright else p[2] - o[2]


def planes(safe_set: SafeSet, p: Vec3) -> tuple[Wall, ...]:
    """All walls and obstacles, the latter as walls seen from ``p`` [m, NED]."""
    if not safe_set.obstacles:
        return safe_set.walls
    return (*safe_set.walls, *(tangent(obstacle, p) for obstacle in safe_set.obstacles))
