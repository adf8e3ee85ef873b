"""MPC-HC: the safe set itself as rows (eqs 14 and 15, and points), without regard to velocity.

The rows have the same shape as a barrier's, with the distance in place of h, so that the
same program carries both; whether they are softened is the program's penalty, not theirs.

Source: docs/equations.md E14, E15.
"""

from __future__ import annotations

import numpy as np

from fsw.barriers.constraint_block import ConstraintBlock, TargetPoints
from fsw.barriers.point_obstacle import vertical_shares
from fsw.model.linearisation import BASE, POINTS, Linearisation
from fsw.model.prediction import INPUTS, Array
from fsw.signals import PointObstacle, Wall, WorkspaceSphere

_CENTRE_BALL = 1e-6  # m; at the centre any outward direction does


class HardWalls:
    """Distance of every critical point to every wall, at every node."""

    def __init__(
        self, walls: tuple[Wall, ...], horizon: int, tightening: float, first_node: int
    ) -> None:
        self._normals = np.array([wall.normal for wall in walls]).reshape(-1, 3)
        self._offsets = np.array([wall.offset + wall.clearance for wall in walls])
        self._first = first_node
        nodes = np.arange(first_node, horizon + 1)
        node, wall, _ = np.meshgrid(nodes, np.arange(len(walls)), np.arange(POINTS), indexing="ij")
        slack = (node - first_node) * len(walls) + wall
        self.rows = ConstraintBlock(node.ravel(), slack.ravel(), INPUTS * horizon)
        self.rows.lower_bound[:] = tightening
        self._start = np.zeros(len(walls) * POINTS)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise the distances."""
        first, rows = self._first, self.rows
        distance = np.einsum("wa,ipa->iwp", self._normals, horizon.position)
        distance -= self._offsets[:, None]
        self._start[:] = distance[0].ravel()
        rows.value[:] = distance[first:].ravel()
        gradient = np.einsum("wa,ipak->iwpk", self._normals, horizon.d_position[first:])
        rows.gradient[:] = gradient.reshape(rows.gradient.shape)

    def at_start(self) -> Array:
        """Distances at node 0 [m]."""
        return self._start


class HardObstacles:
    """Distance of every critical point to every obstacle, at every node."""

    def __init__(
        self,
        obstacles: tuple[PointObstacle, ...],
        horizon: int,
        tightening: float,
        first_node: int,
    ) -> None:
        self._centres = np.array([obstacle.position for obstacle in obstacles])
        self._clearances = np.array([obstacle.clearance for obstacle in obstacles])
        self._verticals = vertical_shares(obstacles)[:, None]
        self._first = first_node
        count, nodes = len(obstacles), np.arange(first_node, horizon + 1)
        node, number, _ = np.meshgrid(nodes, np.arange(count), np.arange(POINTS), indexing="ij")
        slack = (node - first_node) * count + number
        self.rows = ConstraintBlock(node.ravel(), slack.ravel(), INPUTS * horizon)
        self.rows.lower_bound[:] = tightening
        self._start = np.zeros(count * POINTS)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise the distances along the rays of the guess."""
        away = horizon.position[:, None] - self._centres[:, None]
        away[..., 2] *= self._verticals
        length = np.sqrt(np.einsum("ikpa,ikpa->ikp", away, away))
        rays = away / np.maximum(length, _CENTRE_BALL)[..., None]
        distance = length - self._clearances[:, None]
        first, rows = self._first, self.rows
        self._start[:] = distance[0].ravel()
        rows.value[:] = distance[first:].ravel()
        gradient = np.einsum("ikpa,ipac->ikpc", rays[first:], horizon.d_position[first:])
        rows.gradient[:] = gradient.reshape(rows.gradient.shape)

    def at_start(self) -> Array:
        """Distances at node 0 [m]."""
        return self._start


class HardWorkspace:
    """Distance of the base to the sphere's surface, inside positive, at every node."""

    def __init__(
        self, sphere: WorkspaceSphere, horizon: int, tightening: float, first_node: int
    ) -> None:
        self._radius = sphere.radius
        self._offset = np.array(sphere.centre_from_target)
        self._first = first_node
        nodes = np.arange(first_node, horizon + 1)
        self.rows = ConstraintBlock(nodes, nodes - first_node, INPUTS * horizon)
        self.rows.lower_bound[:] = tightening
        self._start = np.zeros(1)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise the distances along the outward ray of the guess."""
        e = horizon.position[:, BASE] - targets.position - self._offset
        length = np.sqrt(np.einsum("ia,ia->i", e, e))
        outward = e / np.maximum(length, _CENTRE_BALL)[:, None]
        self._start[0] = self._radius - length[0]
        first, rows = self._first, self.rows
        rows.value[:] = self._radius - length[first:]
        rows.gradient[:] = -np.einsum(
            "ia,iak->ik", outward[first:], horizon.d_position[first:, BASE]
        )

    def at_start(self) -> Array:
        """Distance at node 0 [m], (1,)."""
        return self._start
