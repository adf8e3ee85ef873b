r"""What a change of the safe set does: whether it lets the vehicle go anywhere it could not before.

A change is a *shrink* if every place that is safe in the new set was safe in the old one. That is
shown shape by shape: each shape of the old set must be implied by a single one of the new set,

* a wall by a parallel one that is no further out, clearance included,
* a ball by a ball or an upright cylinder that contains it, a cylinder by a cylinder, either by a
  wall with all of it behind,
* a workspace sphere by one that lies in it.

What cannot be shown so counts as growth: a wall that turns by a hair, two shapes that only together
cover a third.
"""

from __future__ import annotations

import math

from fsw.geometry.vectors import dot
from fsw.signals import PointObstacle, SafeSet, Wall, WorkspaceSphere


def growth(old: SafeSet, new: SafeSet) -> str:
    """Where ``new`` may let the vehicle go beyond ``old``, in words; empty if it is a shrink."""
    for number, wall in enumerate(old.walls):
        if wall not in new.walls and not any(_keeps_wall(one, wall) for one in new.walls):
            return f"wall {number} {_moved_out(wall, new.walls)}"
    for number, obstacle in enumerate(old.obstacles):
        if obstacle not in new.obstacles and not _keeps_obstacle(new, obstacle):
            return f"obstacle {number} {_moved_off(obstacle, new.obstacles)}"
    if old.sphere is not None and not _keeps_sphere(new.sphere, old.sphere):
        what = "is removed" if new.sphere is None else "grows"
        return f"the workspace sphere {what}"
    return ""


def summary(safe_set: SafeSet) -> str:
    """What a safe set consists of, in words."""
    parts = [
        f"{len(shapes)} {name}{'' if len(shapes) == 1 else 's'}"
        for name, shapes in (("wall", safe_set.walls), ("obstacle", safe_set.obstacles))
        if shapes
    ]
    if safe_set.sphere is not None:
        parts.append(f"a workspace sphere of {safe_set.sphere.radius * 1e3:.0f} mm")
    return ", ".join(parts) or "nothing to keep clear of"


def _keeps_wall(new: Wall, old: Wall) -> bool:
    return new.normal == old.normal and new.offset + new.clearance >= old.offset + old.clearance


def _keeps_obstacle(new: SafeSet, old: PointObstacle) -> bool:
    return any(_contains(one, old) for one in new.obstacles) or any(
        _is_behind(wall, old) for wall in new.walls
    )


def _contains(new: PointObstacle, old: PointObstacle) -> bool:
    """Whether the ball or cylinder of one obstacle contains that of another."""
    if old.upright and not new.upright:
        return False
    (x, y, z), (ox, oy, oz) = new.position, old.position
    apart = math.hypot(x - ox, y - oy, 0.0 if new.upright else z - oz)
    return apart + old.clearance <= new.clearance


def _is_behind(wall: Wall, old: PointObstacle) -> bool:
    """Whether all of an obstacle's ball or cylinder lies where a wall forbids to be."""
    if old.upright and wall.normal[2] != 0.0:
        return False
    depth = wall.offset + wall.clearance - dot(wall.normal, old.position)
    return depth >= old.clearance


def _keeps_sphere(new: WorkspaceSphere | None, old: WorkspaceSphere) -> bool:
    if new is None:
        return False
    return math.dist(new.centre_from_target, old.centre_from_target) + new.radius <= old.radius


def _moved_out(old: Wall, walls: tuple[Wall, ...]) -> str:
    parallel = [wall for wall in walls if wall.normal == old.normal]
    if not parallel:
        return "is removed or turned"
    nearest = max(wall.offset + wall.clearance for wall in parallel)
    return f"moves out by {(old.offset + old.clearance - nearest) * 1e3:.1f} mm"


def _moved_off(old: PointObstacle, obstacles: tuple[PointObstacle, ...]) -> str:
    for one in obstacles:
        if (one.position, one.upright) == (old.position, old.upright):
            return f"shrinks by {(old.clearance - one.clearance) * 1e3:.1f} mm"
    return "is removed or moved"
