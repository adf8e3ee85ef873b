"""Where the base may be for the end-effector to reach a fixed point (Fig. 2 of the paper).

The body is level, so the set is planar (x along the arm's plane, ``up`` against gravity, both
from the end-effector) and turns about the vertical with yaw: a disc in the plane is a sphere
in space. Its boundary consists of arcs on which a joint is at a limit or the arm is
stretched; the inscribed radius is the distance to the nearest point of those arcs that has
the outside next to it. Arcs are sampled with their end points exact, every 0.03 mm or finer,
so a radius is off by no more than half of that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fsw.autopilot.model.airframe import AIRFRAME

Array = NDArray[np.float64]
BOTH_ELBOWS = (1, -1)  # sign of theta_2

_ARC_POINTS = 20_001
_BESIDE = 1e-7  # m, to either side of an arc
_ROUNDING = 1e-9  # rad


@dataclass(frozen=True, slots=True)
class Inscribed:
    """A disc of the plane, a sphere of space, that lies inside the inverse workspace."""

    x_m: float
    up_m: float
    radius_m: float


class InverseWorkspace:
    """The set of base positions of one arm, which may use these ``elbows``, signs of theta_2."""

    def __init__(self, elbows: tuple[int, ...] = BOTH_ELBOWS) -> None:
        # Of the paper's arm: two links in a plane, with limits of the first and of both together.
        self._links = AIRFRAME.bodies.offset[5], AIRFRAME.bodies.tip[2]  # m
        self._limits = tuple(limit.high for limit in AIRFRAME.angle_limits)  # rad
        self._elbows = elbows
        self.boundary = self._outline()  # (n, 2) m
        self._nearest = cKDTree(self.boundary)

    def contains(self, x: Array, up: Array) -> NDArray[np.bool_]:
        """Whether some permitted elbow reaches the end-effector from these base positions.

        ``x`` (n,) [m] is forward of the end-effector, ``up`` (n,) [m] above it.
        """
        l1, l2 = self._links
        cosine = (x * x + up * up - l1 * l1 - l2 * l2) / (2.0 * l1 * l2)
        bend = np.arccos(np.clip(cosine, -1.0, 1.0))
        reachable = np.abs(cosine) <= 1.0
        inside = np.zeros(np.shape(reachable), dtype=bool)
        for elbow in self._elbows:
            th2 = elbow * bend
            along, across = l1 + l2 * np.cos(th2), l2 * np.sin(th2)
            # The end-effector is at (-x, up) in (sine, cosine) of the angles from straight down.
            th1 = np.arctan2(-x, up) - np.arctan2(across, along)
            th1 = np.remainder(th1 + math.pi, 2.0 * math.pi) - math.pi
            inside |= reachable & self._permitted(th1, th1 + th2)
        return inside

    def inscribed_radius(self, x: float, up: float) -> float:
        """Radius [m] of the largest disc about ``x``, ``up`` [m]; negative outside the set."""
        return float(self._radii(np.array([x]), np.array([up]))[0])

    def largest(self, *, on_axis: bool = False) -> Inscribed:
        """The largest inscribed disc, anywhere or with its centre straight above the point.

        A grid over the whole set is refined around its best point until 0.01 mm.
        """
        reach = sum(self._links)
        step, span = reach / 60.0, reach
        best = Inscribed(0.0, 0.0, self.inscribed_radius(0.0, 0.0))
        while step > 1e-5:
            offsets = np.arange(-span, span + 0.5 * step, step)
            across = np.zeros(1) if on_axis else offsets
            x, up = np.meshgrid(best.x_m + across, best.up_m + offsets)
            radii = self._radii(x.ravel(), up.ravel())
            k = int(np.argmax(radii))
            if radii[k] > best.radius_m:
                best = Inscribed(float(x.flat[k]), float(up.flat[k]), float(radii[k]))
            span, step = 2.0 * step, 0.25 * step
        return best

    def _radii(self, x: Array, up: Array) -> Array:
        distance = self._nearest.query(np.stack([x, up], axis=1))[0]
        return np.asarray(np.where(self.contains(x, up), distance, -distance))

    def _permitted(self, th1: Array, th12: Array) -> NDArray[np.bool_]:
        first, both = self._limits
        return np.asarray((np.abs(th1) <= first + _ROUNDING) & (np.abs(th12) <= both + _ROUNDING))

    def _outline(self) -> Array:
        """Points of every limiting arc that have the outside on one side."""
        first, second = self._limits
        sweep1 = np.linspace(-first, first, _ARC_POINTS)
        sweep12 = np.linspace(-second, second, _ARC_POINTS)
        arcs = [(sweep1, sweep1), (sweep1, sweep1 + math.pi)]  # stretched, folded
        arcs += [(np.full(_ARC_POINTS, s * first), sweep12) for s in (1.0, -1.0)]
        arcs += [(sweep1, np.full(_ARC_POINTS, s * second)) for s in (1.0, -1.0)]
        return np.concatenate([self._exposed(th1, th12) for th1, th12 in arcs])

    def _exposed(self, th1: Array, th12: Array) -> Array:
        l1, l2 = self._links
        x = -l1 * np.sin(th1) - l2 * np.sin(th12)
        up = l1 * np.cos(th1) + l2 * np.cos(th12)
        bend = np.remainder(th12 - th1 + math.pi, 2.0 * math.pi) - math.pi
        straight = (np.abs(bend) < _ROUNDING) | (np.abs(bend) > math.pi - _ROUNDING)
        mine = self._permitted(th1, th12) & (straight | np.isin(np.sign(bend), self._elbows))
        along_x, along_up = np.gradient(x), np.gradient(up)
        length = np.maximum(np.hypot(along_x, along_up), 1e-300)
        nx, nup = -along_up / length * _BESIDE, along_x / length * _BESIDE
        covered = self.contains(x + nx, up + nup) & self.contains(x - nx, up - nup)
        return np.stack([x, up], axis=1)[mine & ~covered]
