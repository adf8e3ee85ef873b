r"""MPC-SC: safety as a cost (eqs 29 and 30), and the centring that is its fair relative.

Eq 29 is symmetric about :math:`s_{min}`: past it, it would push deeper. Here it is
one-sided, :math:`\varphi(d) = 1/(W d^2)` of the gap d beyond :math:`s_{min}`, continued from
a small gap on by its second-order Taylor polynomial, so that it stays finite, convex and
decreasing wherever the vehicle is found. The weight stands in the denominator, as printed.

Source: docs/equations.md E29, E30.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.barriers.zone_rows import ZoneRows
from fsw.autopilot.geometry.vectors import dot, subtract, three
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array, P
from fsw.autopilot.mpc.costs import Quadratic, add_square
from fsw.autopilot.mpc.planner_config import SoftWeights
from fsw.autopilot.signals import Zone
from fsw.compiled import kernel

_MIN_GAP = 0.02  # m; from here on eq 29 goes on as a parabola


class ZoneCost:
    """Eq 29 of the distance of every probe to every zone, at every node."""

    def __init__(self, distances: ZoneRows, weights: SoftWeights) -> None:
        self._distances = distances
        self._weights = (weights.wall, weights.wall_terminal)

    def add(self, horizon: Linearisation, targets: TargetPoints, quadratic: Quadratic) -> float:
        """See ``fsw.autopilot.mpc.costs.Cost``."""
        self._distances.refill(horizon, targets)
        rows = self._distances.rows
        weights, inputs = self._weights, horizon.model.inputs
        return _add_gaps(*weights, inputs, rows.node, rows.value, rows.gradient, quadratic)


class SphereCost:
    """``weight |e|^2`` of the base's offset e from the sphere's centre at every node.

    Eq 30 applies it only where ``|e| >= r``; centring applies it everywhere.
    """

    def __init__(self, sphere: Zone, weights: tuple[float, float], *, only_outside: bool) -> None:
        """The zone ``sphere`` follows the target; ``weights`` [1/m^2], the last is terminal."""
        *offset, radius = sphere.shape.numbers
        self._offset, self._weights = np.array(offset), weights
        self._from_radius = radius if only_outside else -1.0

    def add(self, horizon: Linearisation, targets: TargetPoints, quadratic: Quadratic) -> float:
        """See ``fsw.autopilot.mpc.costs.Cost``."""
        return _add_sphere(
            targets.position + self._offset,
            self._from_radius,
            *self._weights,
            horizon.model.inputs,
            horizon.states[:, P : P + 3],
            horizon.model.gamma[:, P : P + 3],
            quadratic,
        )


@kernel
def one_sided_reciprocal(gap: float, weight: float) -> tuple[float, float, float]:
    """Eq 29 of a ``gap`` [m] and ``weight`` [1/m^2]: value, slope (< 0) and curvature (> 0)."""
    d = max(gap, _MIN_GAP)
    value, slope, curvature = 1.0 / d**2, -2.0 / d**3, 6.0 / d**4
    step = min(gap - d, 0.0)
    value += step * (slope + 0.5 * step * curvature)
    slope += step * curvature
    return value / weight, slope / weight, curvature / weight


@kernel
def _add_gaps(
    weight: float,
    terminal: float,
    inputs: int,
    node: NDArray[np.intp],
    gap: Array,
    gradient: Array,
    quadratic: Quadratic,
) -> float:
    cost = 0.0
    for row in range(len(node)):
        columns = inputs * node[row]
        w = terminal if columns == len(quadratic.guess) else weight
        value, slope, curvature = one_sided_reciprocal(gap[row], w)
        cost += value
        # value + slope x + curvature x^2 / 2 as a square about its minimum.
        add_square(0.5 * curvature, slope / curvature, gradient[row], columns, quadratic)
    return cost


@kernel
def _add_sphere(
    centre: Array,
    from_radius: float,
    weight: float,
    terminal: float,
    inputs: int,
    position: Array,
    d_position: Array,
    quadratic: Quadratic,
) -> float:
    n = position.shape[0] - 1
    cost = 0.0
    for i in range(1, n + 1):
        e = subtract(three(position[i], 0), three(centre[i], 0))
        square = dot(e, e)
        if math.sqrt(square) < from_radius:
            continue
        w = terminal if i == n else weight
        cost += w * square
        for axis in range(3):
            add_square(w, e[axis], d_position[i, axis], inputs * i, quadratic)
    return cost
