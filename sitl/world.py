"""Walls, workspace and ground, judged on the plant's true state.

Source: docs/equations.md E14, E15.
"""

from __future__ import annotations

import math

from sitl.scenario import V3, Scenario, Workspace

POINTS = ("base", "joint2", "end_effector")  # critical points, in the order of the paper


def workspace_margin(workspace: Workspace, p_base: V3, p_target: V3) -> float:
    """R − |base − centre| [m]; the centre rides ``d_iw`` above the end-effector's reference."""
    x, y = p_base[0] - p_target[0], p_base[1] - p_target[1]
    z = p_base[2] - (p_target[2] - workspace.d_iw_m)
    distance: float = (x * x + y * y + z * z) ** 0.5
    return workspace.radius_m - distance


class World:
    """The surroundings of one scenario."""

    def __init__(self, scenario: Scenario) -> None:
        self.walls = scenario.walls
        self.workspace = scenario.workspace
        wall_keys = [f"{wall.name}/{point}" for wall in self.walls for point in POINTS]
        self._planes = [(*wall.normal, wall.offset_m + wall.clearance_m) for wall in self.walls]
        self.keys = (*wall_keys, *(("workspace/base",) if self.workspace else ()))

    def margins(self, points: tuple[V3, V3, V3], target: V3 | None) -> tuple[float, ...]:
        """Margins [m] in the order of ``keys``; negative means violated.

        Args:
            points: Base, joint 2 and end-effector [m, NED].
            target: End-effector reference [m, NED]; None while the workspace does not apply,
                its margin is then infinite.
        """
        values = [
            a * x + b * y + c * z - limit for a, b, c, limit in self._planes for x, y, z in points
        ]
        if self.workspace is not None:
            values.append(
                math.inf if target is None else workspace_margin(self.workspace, points[0], target)
            )
        return tuple(values)

    def collision(self, points: tuple[V3, V3, V3], margins: tuple[float, ...]) -> str | None:
        """A sentence if a critical point touches a wall or the ground, else None.

        Args:
            points: Base, joint 2 and end-effector [m, NED].
            margins: Their margins, from ``margins``.
        """
        (_, _, base), (_, _, joint2), (_, _, end) = points
        if max(base, joint2, end) < 0.0 < min(margins, default=1.0):
            return None
        for i, wall in enumerate(self.walls):
            for k, name in enumerate(POINTS):
                if not (margins[len(POINTS) * i + k] + wall.clearance_m > 0.0):
                    return f"{spoken(name)} hit the {wall.name} wall"
        for name, point in zip(POINTS, points, strict=True):
            if not (point[2] < 0.0):
                return f"{spoken(name)} hit the ground"
        return None


def spoken(point: str) -> str:
    """A critical point's name as part of a sentence."""
    return {"base": "the base", "joint2": "joint 2", "end_effector": "the end-effector"}[point]
