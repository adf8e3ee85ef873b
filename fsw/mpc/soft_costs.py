r"""MPC-SC: safety as a cost (eqs 29 and 30), and the centring that is its fair relative.

Eq 29 is symmetric about :math:`s_{min}`: past it, it would push deeper. Here it is
one-sided, :math:`\varphi(d) = 1/(W d^2)` of the gap d beyond :math:`s_{min}`, continued from
a small gap on by its second-order Taylor polynomial, so that it stays finite, convex and
decreasing wherever the vehicle is found. The weight stands in the denominator, as printed.

Source: docs/equations.md E29, E30.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fsw.barriers.constraint_block import TargetPoints
from fsw.barriers.point_obstacle import vertical_shares
from fsw.barriers.tangent import CENTRE_BALL
from fsw.compiled import compiled
from fsw.model.linearisation import BASE, POINTS, Linearisation
from fsw.model.prediction import INPUTS, Array
from fsw.mpc.costs import Quadratic, add_square
from fsw.signals import PointObstacle, Wall, WorkspaceSphere

_LEAST_GAP = 0.02  # m; from here on eq 29 goes on as a parabola


@dataclass(frozen=True, slots=True)
class SoftWeights:
    """Weights of Table II for eqs 29 and 30, and of our centring."""

    wall: float = 5.0  # w_4
    wall_terminal: float = 20.0  # w_s4
    workspace: float = 5.0  # w_5
    workspace_terminal: float = 20.0  # w_s5
    centring: float = 100.0  # ours, for the like-for-like Naive


class SoftWallCost:
    """Eq 29 for every wall, critical point and node."""

    def __init__(self, walls: tuple[Wall, ...], weights: SoftWeights) -> None:
        self._normals = np.array([wall.normal for wall in walls]).reshape(-1, 3)
        self._offsets = np.array([wall.offset + wall.clearance for wall in walls])
        self._weights = (weights.wall, weights.wall_terminal)

    def add(
        self,
        horizon: Linearisation,
        targets: TargetPoints,
        quadratic: Quadratic,
    ) -> float:
        """See ``fsw.mpc.costs.Cost``."""
        return _add_walls(
            self._normals,
            self._offsets,
            *self._weights,
            horizon.position,
            horizon.d_position,
            quadratic,
        )


class SoftObstacleCost:
    """Eq 29 of the distance to every obstacle, along the ray of the guess."""

    def __init__(self, obstacles: tuple[PointObstacle, ...], weights: SoftWeights) -> None:
        self._centres = np.array([obstacle.position for obstacle in obstacles])
        self._clearances = np.array([obstacle.clearance for obstacle in obstacles])
        self._verticals = vertical_shares(obstacles)
        self._weights = (weights.wall, weights.wall_terminal)

    def add(
        self,
        horizon: Linearisation,
        targets: TargetPoints,
        quadratic: Quadratic,
    ) -> float:
        """See ``fsw.mpc.costs.Cost``."""
        return _add_obstacles(
            self._centres,
            self._clearances,
            self._verticals,
            *self._weights,
            horizon.position,
            horizon.d_position,
            quadratic,
        )


class SphereCost:
    """``weight |e|^2`` of the base's offset e from the sphere's centre at every node.

    Eq 30 applies it only where ``|e| >= r``; centring applies it everywhere.
    """

    def __init__(
        self, sphere: WorkspaceSphere, weight: float, terminal: float, *, only_outside: bool
    ) -> None:
        self._offset = np.array(sphere.centre_from_target)
        self._weights = (weight, terminal)
        self._from_radius = sphere.radius if only_outside else -1.0

    def add(
        self,
        horizon: Linearisation,
        targets: TargetPoints,
        quadratic: Quadratic,
    ) -> float:
        """See ``fsw.mpc.costs.Cost``."""
        return _add_sphere(
            targets.position + self._offset,
            self._from_radius,
            *self._weights,
            horizon.position[:, BASE],
            horizon.d_position[:, BASE],
            quadratic,
        )


@compiled
def one_sided_reciprocal(gap: float, weight: float) -> tuple[float, float, float]:
    """Eq 29 of a ``gap`` [m] and ``weight`` [1/m^2]: value, slope (< 0) and curvature (> 0)."""
    d = max(gap, _LEAST_GAP)
    value, slope, curvature = 1.0 / d**2, -2.0 / d**3, 6.0 / d**4
    step = min(gap - d, 0.0)
    value += step * (slope + 0.5 * step * curvature)
    slope += step * curvature
    return value / weight, slope / weight, curvature / weight


@compiled
def _add_walls(
    normals: Array,
    offsets: Array,
    weight: float,
    terminal: float,
    position: Array,
    d_position: Array,
    quadratic: Quadratic,
) -> float:
    n = position.shape[0] - 1
    row = np.zeros(quadratic.guess.shape[0])
    cost = 0.0
    for i in range(1, n + 1):
        for wall in range(normals.shape[0]):
            nx, ny, nz = normals[wall]
            for point in range(POINTS):
                p, dp = position[i, point], d_position[i, point]
                gap = nx * p[0] + ny * p[1] + nz * p[2] - offsets[wall]
                for k in range(INPUTS * i):
                    row[k] = nx * dp[0, k] + ny * dp[1, k] + nz * dp[2, k]
                w = terminal if i == n else weight
                cost += _add_gap(gap, w, row, INPUTS * i, quadratic)
    return cost


@compiled
def _add_obstacles(
    centres: Array,
    clearances: Array,
    verticals: Array,
    weight: float,
    terminal: float,
    position: Array,
    d_position: Array,
    quadratic: Quadratic,
) -> float:
    n = position.shape[0] - 1
    row = np.zeros(quadratic.guess.shape[0])
    cost = 0.0
    for i in range(1, n + 1):
        for number in range(centres.shape[0]):
            for point in range(POINTS):
                away, dp = position[i, point] - centres[number], d_position[i, point]
                x, y, z = away[0], away[1], verticals[number] * away[2]
                length = math.sqrt(x * x + y * y + z * z)
                scale = 1.0 / max(length, CENTRE_BALL)
                for k in range(INPUTS * i):
                    row[k] = scale * (x * dp[0, k] + y * dp[1, k] + z * dp[2, k])
                w, gap = terminal if i == n else weight, length - clearances[number]
                cost += _add_gap(gap, w, row, INPUTS * i, quadratic)
    return cost


@compiled
def _add_gap(
    gap: float,
    weight: float,
    row: Array,
    columns: int,
    quadratic: Quadratic,
) -> float:
    """Eq 29 of one gap that moves with the inputs by ``row``."""
    value, slope, curvature = one_sided_reciprocal(gap, weight)
    # value + slope x + curvature x^2 / 2 as a square about its minimum.
    add_square(0.5 * curvature, slope / curvature, row, columns, quadratic)
    return value


@compiled
def _add_sphere(
    centre: Array,
    from_radius: float,
    weight: float,
    terminal: float,
    position: Array,
    d_position: Array,
    quadratic: Quadratic,
) -> float:
    n = position.shape[0] - 1
    cost = 0.0
    for i in range(1, n + 1):
        e = position[i] - centre[i]
        square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2]
        if math.sqrt(square) < from_radius:
            continue
        w = terminal if i == n else weight
        cost += w * square
        for axis in range(3):
            add_square(w, e[axis], d_position[i, axis], INPUTS * i, quadratic)
    return cost
