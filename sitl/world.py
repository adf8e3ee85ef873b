"""Walls, obstacles, workspace and ground, judged on the plant's true state.

Source: docs/equations.md E11, E14, E15.
"""

from __future__ import annotations

import math

import numpy as np

from sitl.compiled import compiled
from sitl.plant.vector import Array
from sitl.scenario import V3, Scenario, Workspace
from sitl.trajectory import place_on_curve

CRITICAL_POINTS = ("base", "joint2", "end_effector")  # critical points, in the order of the paper


def workspace_margin(workspace: Workspace, p_base: V3, p_target: V3) -> float:
    """R − |base − centre| [m] of a base at p_base [m, NED].

    The centre is ``d_iw`` above the end-effector's reference, p_target [m, NED].
    """
    x, y = p_base[0] - p_target[0], p_base[1] - p_target[1]
    z = p_base[2] - (p_target[2] - workspace.d_iw_m)
    distance: float = (x * x + y * y + z * z) ** 0.5
    return workspace.radius_m - distance


class World:
    """The surroundings of one scenario."""

    def __init__(self, scenario: Scenario) -> None:
        self.walls = scenario.walls
        self.workspace = scenario.workspace
        names = [one.name for one in self.walls] + [one.name for one in scenario.obstacles]
        keys = [f"{name}/{point}" for name in names for point in CRITICAL_POINTS]
        self._planes = [(*wall.normal, wall.offset_m + wall.clearance_m) for wall in self.walls]
        self.planes = np.array(self._planes).reshape(-1, 4)  # normal, least distance [m]
        self._balls = [(*one.position_m, one.clearance_m) for one in scenario.obstacles]
        self.balls = np.array(self._balls).reshape(-1, 4)  # centre, least distance [m]
        workspace = self.workspace
        self.sphere = (0.0, 0.0) if workspace is None else (workspace.radius_m, workspace.d_iw_m)
        self.keys = (*keys, *(("workspace/base",) if self.workspace else ()))

    def margins(self, points: tuple[V3, V3, V3], target: V3 | None) -> tuple[float, ...]:
        """Margins [m] of base, joint 2 and end-effector, as ``keys``; negative means violated.

        Without ``target`` [m, NED], the end-effector's reference, the workspace does not apply: its
        margin is infinite.
        """
        values = [
            a * x + b * y + c * z - limit for a, b, c, limit in self._planes for x, y, z in points
        ]
        values += [
            math.dist((x, y, z), points_at) - radius
            for *points_at, radius in self._balls
            for x, y, z in points
        ]
        if self.workspace is not None:
            values.append(
                math.inf if target is None else workspace_margin(self.workspace, points[0], target)
            )
        return tuple(values)

    def collision(self, points: tuple[V3, V3, V3], margins: tuple[float, ...]) -> str | None:
        """A sentence if a point with these margins touches a wall or the ground, else None.

        An obstacle is a point and cannot be touched: coming too close to it is a violation only.
        """
        (_, _, base), (_, _, joint2), (_, _, end) = points
        if max(base, joint2, end) < 0.0 < min(margins, default=1.0):
            return None
        for i, wall in enumerate(self.walls):
            for k, name in enumerate(CRITICAL_POINTS):
                if not (margins[len(CRITICAL_POINTS) * i + k] + wall.clearance_m > 0.0):
                    return f"{spoken(name)} hit the {wall.name} wall"
        for name, point in zip(CRITICAL_POINTS, points, strict=True):
            if not (point[2] < 0.0):
                return f"{spoken(name)} hit the ground"
        return None


@compiled
def record_if_clear(
    planes: Array,
    balls: Array,
    sphere: tuple[float, float],
    aim: tuple[Array, float],
    places: Array,
    instants: tuple[float, float],
    lowest: Array,
    when_s: Array,
) -> bool:
    """``World.margins`` of plant steps without any incident, into the record of the smallest.

    Args:
        planes: (walls, 4) [m] of a World.
        balls: (obstacles, 4) [m] of a World.
        sphere: Its radius and height above the target [m].
        aim: The end-effector's ``curve_row`` and when it begins [s]; an empty row where the
            workspace does not apply.
        places: (steps, 2 + j, 3) [m, NED]: base, joint 1, joint 2, …, end-effector.
        instants: Time one step before the first, and between two steps [s].
        lowest: (margins,) [m], smallest so far.
        when_s: (margins,) [s], when that was.

    Returns:
        True; or False, with nothing recorded, if any point is not clearly above ground and
        within every margin.
    """
    margins = np.empty((places.shape[0], lowest.shape[0]))
    before_s, step_s = instants
    curve, starts_s = aim
    for k in range(places.shape[0]):
        _wall_margins_into(planes, places, k, margins)
        _obstacle_margins_into(balls, places, k, margins[:, 3 * planes.shape[0] :])
        if curve.shape[0]:
            target = place_on_curve(curve, before_s + (k + 1) * step_s - starts_s)
            margins[k, margins.shape[1] - 1] = _sphere_margin(sphere, target, places, k)
        above = places[k, 0, 2] < 0.0 and places[k, 2, 2] < 0.0 and places[k, -1, 2] < 0.0
        if not (above and (margins[k] > 0.0).all()):
            return False
    for k in range(places.shape[0]):
        for i in range(lowest.shape[0]):
            if margins[k, i] < lowest[i]:
                lowest[i] = margins[k, i]
                when_s[i] = before_s + (k + 1) * step_s
    return True


@compiled
def _wall_margins_into(planes: Array, places: Array, k: int, margins: Array) -> None:
    for i in range(planes.shape[0]):
        a, b, c, limit = planes[i, 0], planes[i, 1], planes[i, 2], planes[i, 3]
        for point, row in enumerate((0, 2, places.shape[1] - 1)):
            x, y, z = places[k, row, 0], places[k, row, 1], places[k, row, 2]
            margins[k, 3 * i + point] = a * x + b * y + c * z - limit


@compiled
def _obstacle_margins_into(balls: Array, places: Array, k: int, margins: Array) -> None:
    for i in range(balls.shape[0]):
        for point, row in enumerate((0, 2, places.shape[1] - 1)):
            x, y = places[k, row, 0] - balls[i, 0], places[k, row, 1] - balls[i, 1]
            z = places[k, row, 2] - balls[i, 2]
            margins[k, 3 * i + point] = math.sqrt(x * x + y * y + z * z) - balls[i, 3]


@compiled
def _sphere_margin(sphere: tuple[float, float], target: V3, places: Array, k: int) -> float:
    radius, above = sphere
    x, y = places[k, 0, 0] - target[0], places[k, 0, 1] - target[1]
    z = places[k, 0, 2] - (target[2] - above)
    distance: float = np.sqrt(x * x + y * y + z * z)
    return radius - distance


def spoken(point: str) -> str:
    """A critical point's name as part of a sentence."""
    return {"base": "the base", "joint2": "joint 2", "end_effector": "the end-effector"}[point]
