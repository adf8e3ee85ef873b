"""References that do not ask the vehicle to leave its safe set.

The barriers keep the vehicle inside whatever is asked for, at a price that a reference far
outside could outbid. So no reference of the vehicle's own leads farther than to the boundary.
"""

from __future__ import annotations

from dataclasses import replace

from fsw.barriers.tangent import planes
from fsw.signals import EndEffectorTarget, SafeSet, Vec3

_ROUNDS = 30  # projections one after the other; in a corner they have to settle
_NEAR_ENOUGH = 1e-4  # m


def joined(announced: SafeSet, fence: SafeSet) -> SafeSet:
    """Both safe sets at once."""
    return SafeSet(
        announced.walls + fence.walls,
        announced.sphere or fence.sphere,
        announced.obstacles + fence.obstacles,
    )


def contradictions(safe_set: SafeSet) -> tuple[str, ...]:
    """Why nobody could keep a safe set: the planner knows walls and points, or a sphere."""
    if safe_set.sphere is None or not (safe_set.walls or safe_set.obstacles):
        return ()
    what = "walls" if safe_set.walls else "points"
    return (f"{what} and a workspace sphere cannot be kept at once",)


def inside(p: Vec3, safe_set: SafeSet) -> Vec3:
    """The point, or one near it that keeps every wall's and obstacle's clearance [m]."""
    for _ in range(_ROUNDS):
        moved = p
        for wall in planes(safe_set, p):
            n = wall.normal
            lacking = wall.offset + wall.clearance - (n[0] * p[0] + n[1] * p[1] + n[2] * p[2])
            if lacking > _NEAR_ENOUGH:
                p = (p[0] + lacking * n[0], p[1] + lacking * n[1], p[2] + lacking * n[2])
        if p is moved:
            break
    return p


def confined(target: EndEffectorTarget, safe_set: SafeSet) -> EndEffectorTarget:
    """The target, or at rest at the boundary where it is beyond a wall or near an obstacle."""
    p = inside(target.p_WE, safe_set)
    if p is target.p_WE:
        return target
    rest = (0.0, 0.0, 0.0)
    return replace(target, p_WE=p, v_WE=rest, a_WE=rest)
