"""What several sensors' errors are made of."""

from __future__ import annotations

import math

import numpy as np

from sitl.plant.vector import Array
from sitl.ranges import V3


class GaussMarkov:
    r"""Values that wander: first-order Gauss–Markov processes, begun in their stationary state.

    .. math:: x_{k+1} = e^{-Δt/T} x_k + σ \sqrt{1 - e^{-2Δt/T}}\, w_k

    Source: P. S. Maybeck, Stochastic Models, Estimation, and Control, vol. 1, 1979, section 4.11.
    """

    def __init__(
        self, sigmas: tuple[float, ...], time_s: float, step_s: float, random: np.random.Generator
    ) -> None:
        """Deviations ``sigmas`` [unit of the values], ``time_s`` [s] and ``step_s`` [s]."""
        self._random = random
        self._keeps = math.exp(-step_s / time_s)
        fresh = math.sqrt(1.0 - self._keeps * self._keeps)
        self._fresh = np.array([fresh * sigma for sigma in sigmas])
        self.draws = len(sigmas) if any(sigmas) else 0  # of a step
        self._values = np.array(sigmas) * random.standard_normal(len(sigmas))

    def step(self) -> list[float]:
        """The values one step later."""
        return self.moved(self._random.standard_normal(self.draws))

    def moved(self, drawn: Array) -> list[float]:
        """The values one step later, with so many ``drawn`` (draws,) [1] of the generator."""
        if self.draws:
            self._values = self._keeps * self._values + self._fresh * drawn
        values: list[float] = self._values.tolist()
        return values


def normal(random: np.random.Generator, sigma: float, count: int) -> list[float]:
    """So many independent draws of deviation ``sigma`` [any unit]."""
    draws: list[float] = (sigma * random.standard_normal(count)).tolist()
    return draws


def anywhere(random: np.random.Generator, length: float) -> V3:
    """A vector of a ``length`` [any unit], uniform on the sphere."""
    x, y, z = random.standard_normal(3).tolist()
    scale = length / math.sqrt(x * x + y * y + z * z)
    return (scale * x, scale * y, scale * z)


def rounded(value: float, resolution: float) -> float:
    """A ``value`` [any unit] on the grid of a ``resolution`` [same unit]; 0: as it is."""
    return resolution * round(value / resolution) if resolution > 0.0 else value


def digits(values: V3, resolution: V3) -> V3:
    """Each of three ``values`` on the grid of its own resolution.

    ``values`` [any unit, any frame] and ``resolution`` [same unit, same frame].
    """
    (x, y, z), (a, b, c) = values, resolution
    return (rounded(x, a), rounded(y, b), rounded(z, c))
