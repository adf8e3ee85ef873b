r"""Turbulence: three components of gust velocity with Dryden's spectra.

Coloured from white noise by the filters of the specification, at low altitude (10 to 1000 ft):

.. math::
    H_u = σ_u \sqrt{\frac{2 L_u}{π V}} \frac{1}{1 + \frac{L_u}{V} s}, \quad
    H_{v,w} = σ \sqrt{\frac{L}{π V}} \frac{1 + \sqrt3 \frac{L}{V} s}{(1 + \frac{L}{V} s)^2}

Source: MIL-F-8785C, 1980, section 3.7.2 (spectra) and 3.7.5 (low altitude); the lengths of v and w
are those of this revision, not halved as in MIL-HDBK-1797.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sitl.plant.vector import V3, Array

_FOOT = 0.3048  # m
LOWEST, HIGHEST = 10.0 * _FOOT, 1000.0 * _FOOT  # m, where the formulas hold
_BLOCK = 256  # steps whose noise is drawn at once


class GustScale(NamedTuple):
    """Deviation [m/s] and length [m] of the gusts along one axis."""

    sigma: float
    length: float


def low_altitude(height: float, wind_at_20_feet: float) -> tuple[GustScale, GustScale, GustScale]:
    """Scales along the mean wind, across it and vertically, at a ``height`` [m] above ground.

    ``wind_at_20_feet`` [m/s] is the specification's measure of strength: 7.7 is light, 15.4
    moderate, 23.1 severe. Outside of 10 to 1000 ft the nearer end counts.
    """
    feet = min(max(height, LOWEST), HIGHEST) / _FOOT
    vertical = 0.1 * wind_at_20_feet
    level = vertical / (0.177 + 0.000823 * feet) ** 0.4
    length = feet / (0.177 + 0.000823 * feet) ** 1.2
    along = GustScale(level, _FOOT * length)
    return along, along, GustScale(vertical, _FOOT * feet)


class Dryden:
    """Gusts of one flight, in the axes of a mean wind; begun in their stationary state."""

    def __init__(
        self,
        scales: tuple[GustScale, GustScale, GustScale],
        airspeed: float,
        step_s: float,
        random: np.random.Generator,
    ) -> None:
        """Gusts that pass at an ``airspeed`` [m/s], sampled every ``step_s`` [s]."""
        self._random = random
        along, across, vertical = scales
        self._keeps = math.exp(-airspeed * step_s / along.length)
        self._fresh = along.sigma * math.sqrt(1.0 - self._keeps**2)
        self._u = along.sigma * float(random.standard_normal())
        self._across = _SecondOrder(across, airspeed, step_s, random)
        self._vertical = _SecondOrder(vertical, airspeed, step_s, random)
        self._draws: list[list[float]] = []

    def step(self) -> V3:
        """Gust along the wind, across it to the right, and down [m/s], one step later."""
        if not self._draws:
            self._draws = self._random.standard_normal((_BLOCK, 5)).tolist()
        a, b, c, d, e = self._draws.pop()
        self._u = self._keeps * self._u + self._fresh * a
        return (self._u, self._across.step(b, c), self._vertical.step(d, e))


class _SecondOrder:
    """One transverse component, its filter sampled exactly.

    With T = L/V the filter is two states, x' = −x/T + w and y' = (x − y)/T, and the gust is
    √3 x + (1 − √3) y, scaled to the deviation.
    """

    def __init__(
        self, scale: GustScale, airspeed: float, step_s: float, random: np.random.Generator
    ) -> None:
        h = airspeed * step_s / scale.length  # in units of T
        e = math.exp(-h)
        # Covariance of x and y in the long run, for white noise of density 1 in units of T.
        rest = np.array([[0.5, 0.25], [0.25, 0.25]])
        move = np.array([[e, 0.0], [h * e, e]])
        root = np.linalg.cholesky(rest - move @ rest @ move.T)
        gain = np.array([math.sqrt(3.0), 1.0 - math.sqrt(3.0)])
        amplitude = scale.sigma / math.sqrt(float(gain @ rest @ gain))
        begin: Array = np.linalg.cholesky(rest) @ random.standard_normal(2)
        self._x, self._y = begin.tolist()
        self._e, self._he = e, h * e
        self._root = (float(root[0, 0]), float(root[1, 0]), float(root[1, 1]))
        self._gain = (amplitude * float(gain[0]), amplitude * float(gain[1]))

    def step(self, first: float, second: float) -> float:
        """The gust [m/s] one step later, from two independent draws of deviation 1."""
        x, y, (xx, yx, yy) = self._x, self._y, self._root
        self._x = self._e * x + xx * first
        self._y = self._he * x + self._e * y + yx * first + yy * second
        gust: float = self._gain[0] * self._x + self._gain[1] * self._y
        return gust
