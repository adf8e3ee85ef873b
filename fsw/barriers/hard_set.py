"""MPC-HC: the safe set itself as rows (eqs 14 and 15, and points), without regard to velocity.

The rows have the same shape as a barrier's, with the distance in place of h, so that the
same program carries both; whether they are softened is the program's penalty, not theirs.

Source: docs/equations.md E14, E15.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from fsw.barriers.constraint_block import TargetPoints, surface_rows
from fsw.barriers.point_obstacle import vertical_shares
from fsw.model.linearisation import BASE, POINTS, Linearisation
from fsw.model.prediction import Array
from fsw.signals import PointObstacle, Wall, WorkspaceSphere

_CENTRE_BALL = 1e-6  # m; at the centre any direction does


class HardSet(ABC):
    """Distances of points to surfaces from a first node on, one slack a node and surface."""

    def __init__(
        self, surfaces: int, points: int, horizon: int, tightening: float, first_node: int
    ) -> None:
        """Lay out the rows, which require a distance of ``tightening`` [m]."""
        self.rows = surface_rows(surfaces, points, first_node, horizon)
        self.rows.lower_bound[:] = tightening
        self._first, self._points = first_node, points

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise the distances along the normals of the guess."""
        first, rows = self._first, self.rows
        distance, normal = self._measure(horizon, targets)
        rows.start[:] = distance[0].ravel()
        rows.value[:] = distance[first:].ravel()
        moved = horizon.d_position[first:, : self._points]
        gradient = np.einsum("ispa,ipac->ispc", normal[first:], moved)
        rows.gradient[:] = gradient.reshape(rows.gradient.shape)

    @abstractmethod
    def _measure(self, horizon: Linearisation, targets: TargetPoints) -> tuple[Array, Array]:
        """Distances (n + 1, surfaces, points) [m] and unit normals into the free side (…, 3)."""


class HardWalls(HardSet):
    """Distance of every critical point to every wall."""

    def __init__(
        self, walls: tuple[Wall, ...], horizon: int, tightening: float, first_node: int
    ) -> None:
        super().__init__(len(walls), POINTS, horizon, tightening, first_node)
        self._normals = np.array([wall.normal for wall in walls])
        self._offsets = np.array([wall.offset + wall.clearance for wall in walls])

    def _measure(self, horizon: Linearisation, targets: TargetPoints) -> tuple[Array, Array]:
        distance = np.einsum("wa,ipa->iwp", self._normals, horizon.position)
        distance -= self._offsets[:, None]
        return distance, np.broadcast_to(self._normals[:, None], (*distance.shape, 3))


class HardObstacles(HardSet):
    """Distance of every critical point to every obstacle, along the ray between them."""

    def __init__(
        self,
        obstacles: tuple[PointObstacle, ...],
        horizon: int,
        tightening: float,
        first_node: int,
    ) -> None:
        super().__init__(len(obstacles), POINTS, horizon, tightening, first_node)
        self._centres = np.array([obstacle.position for obstacle in obstacles])
        self._clearances = np.array([obstacle.clearance for obstacle in obstacles])
        self._verticals = vertical_shares(obstacles)[:, None]

    def _measure(self, horizon: Linearisation, targets: TargetPoints) -> tuple[Array, Array]:
        away = horizon.position[:, None] - self._centres[:, None]
        away[..., 2] *= self._verticals
        length = np.sqrt(np.einsum("ikpa,ikpa->ikp", away, away))
        rays = away / np.maximum(length, _CENTRE_BALL)[..., None]
        return length - self._clearances[:, None], rays


class HardWorkspace(HardSet):
    """Distance of the base to the sphere's surface, inside positive."""

    def __init__(
        self, sphere: WorkspaceSphere, horizon: int, tightening: float, first_node: int
    ) -> None:
        super().__init__(1, 1, horizon, tightening, first_node)
        self._radius = sphere.radius
        self._offset = np.array(sphere.centre_from_target)

    def _measure(self, horizon: Linearisation, targets: TargetPoints) -> tuple[Array, Array]:
        e = (horizon.position[:, BASE] - targets.position - self._offset)[:, None, None]
        length = np.sqrt(np.einsum("ispa,ispa->isp", e, e))
        return self._radius - length, -e / np.maximum(length, _CENTRE_BALL)[..., None]
