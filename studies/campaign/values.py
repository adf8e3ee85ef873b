"""What a campaign varies: distributions, and designs that give each flight its point.

A point is a number from 0 to 1 for each varied key. Point ``k`` depends on the root seed, the case
and ``k`` alone, so flights can be flown in any order, and more of them later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal, TypeAlias

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

Table: TypeAlias = np.ndarray[tuple[int, int], np.dtype[np.float64]]
Design: TypeAlias = Literal["random", "latin-hypercube", "sobol", "grid"]

_DESIGN_KEY: Final = 1 << 31  # of the designs' streams; flights have the numbers below
MAX_FLIGHTS: Final = 10_000_000
_MIN_TABLE: Final = 1 << 10


@dataclass(frozen=True, slots=True)
class Uniform:
    """Any number between two, as likely as any other."""

    low: float
    high: float
    points: int = 0  # on a grid, both ends included

    def at(self, share: float) -> float:
        """The value at a ``share`` of the distribution [1]."""
        return self.low + share * (self.high - self.low)

    def grid(self) -> tuple[float, ...]:
        """The values of a grid; empty if none was asked for."""
        return tuple(float(one) for one in np.linspace(self.low, self.high, self.points))

    def __str__(self) -> str:
        return f"uniform from {self.low:g} to {self.high:g}"


@dataclass(frozen=True, slots=True)
class Turn(Uniform):
    """A full circle on a grid, whose two ends are the same direction: the second is left out."""

    def grid(self) -> tuple[float, ...]:
        """See :class:`Uniform`."""
        ends = np.linspace(self.low, self.high, self.points, endpoint=False)
        return tuple(float(one) for one in ends)

    def __str__(self) -> str:
        return f"a full circle from {self.low:g} to {self.high:g}"


@dataclass(frozen=True, slots=True)
class Normal:
    """The normal distribution, cut off at two ends."""

    mean: float
    deviation: float
    low: float
    high: float
    points: int = 0

    def at(self, share: float) -> float:
        """The value at a ``share`` of the distribution [1]."""
        first, last = (
            float(ndtr((end - self.mean) / self.deviation)) for end in (self.low, self.high)
        )
        value = self.mean + self.deviation * float(ndtri(first + share * (last - first)))
        return min(max(value, self.low), self.high)

    def grid(self) -> tuple[float, ...]:
        """The middles of parts of equal probability; empty if no grid was asked for."""
        return tuple(self.at((i + 0.5) / self.points) for i in range(self.points))

    def __str__(self) -> str:
        return (
            f"normal, mean {self.mean:g}, deviation {self.deviation:g}, "
            f"within {self.low:g} to {self.high:g}"
        )


@dataclass(frozen=True, slots=True)
class Choice:
    """One of some numbers."""

    values: tuple[float, ...]

    def at(self, share: float) -> float:
        """The value at a ``share`` of the distribution [1]."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def grid(self) -> tuple[float, ...]:
        """All of them."""
        return self.values

    def __str__(self) -> str:
        return "one of " + ", ".join(f"{value:g}" for value in self.values)


Distribution: TypeAlias = Uniform | Normal | Choice


def streams(root: int, flight: int) -> np.random.SeedSequence:
    """The random numbers of a flight; they depend on nothing else."""
    return np.random.SeedSequence(root, spawn_key=(flight,))


def seed_of(root: int, flight: int) -> int:
    """The seed of a flight: a whole number below 2^63."""
    return int(streams(root, flight).generate_state(1, np.uint64)[0] >> np.uint64(1))


def drawn(root: int, flight: int, count: int) -> tuple[float, ...]:
    """``count`` numbers from 0 to 1 that belong to a flight alone, besides its seed [1]."""
    own = np.random.SeedSequence(root, spawn_key=(flight, 1))
    return tuple(float(one) for one in np.random.default_rng(own).random(count))


def grid_size(varied: tuple[Distribution, ...]) -> int:
    """How many points a full grid has."""
    return math.prod(len(one.grid()) for one in varied)


def grid_point(varied: tuple[Distribution, ...], number: int) -> tuple[float, ...]:
    """Values of a point of the grid; the last key changes fastest, after the last it repeats."""
    number %= grid_size(varied)
    values: list[float] = []
    for one in reversed(varied):
        number, index = divmod(number, len(one.grid()))
        values.append(one.grid()[index])
    return tuple(reversed(values))


def design_point(
    design: Design, root: int, case: int, number: int, size: int, keys: int
) -> tuple[float, ...]:
    """Point ``number`` of a case's scrambled sequence over ``keys`` keys [1].

    A Latin hypercube has ``size`` points; a Sobol sequence goes on for ever.
    """
    if design == "sobol":
        table = _sobol(root, case, max(_MIN_TABLE, 1 << number.bit_length()), keys)
    else:
        table = _latin_hypercube(root, case, size, keys)
    return tuple(float(one) for one in table[number])


def _generator(root: int, case: int) -> np.random.Generator:
    own = np.random.SeedSequence(root, spawn_key=(_DESIGN_KEY, case))
    return np.random.default_rng(own)


@lru_cache(maxsize=64)
def _sobol(root: int, case: int, size: int, keys: int) -> Table:
    """The first ``size`` points, a power of two; a longer table begins with the shorter one."""
    found: Table = qmc.Sobol(keys, scramble=True, rng=_generator(root, case)).random(size)
    return found


@lru_cache(maxsize=64)
def _latin_hypercube(root: int, case: int, size: int, keys: int) -> Table:
    found: Table = qmc.LatinHypercube(keys, rng=_generator(root, case)).random(size)
    return found
