"""The lower tail of the minimum margins: a generalised Pareto fit and how well it fits.

Of flights that are alike, what lies below a low threshold is distributed by a generalised Pareto
law (Pickands, 1975; Balkema and de Haan, 1974). A fit of it says how margins smaller than all that
were flown thin out. It extrapolates: it is no bound, and no substitute for one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np

from studies.statistics.pareto_intervals import END, SCALE, SHAPE, Intervals, beyond, depth

Array: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]

MIN_FLIGHTS: Final = 100
_MIN_TAIL: Final = 30
_TAIL_SHARE: Final = 0.1
_MIN_DISTINCT: Final = 20
REJECTED: Final = 0.05  # of goodness; below, the numbers are not to be used
_MAX_SCALED: Final = 99  # refits that the intervals are scaled with
RARE: Final = (1e-2, 1e-3, 1e-4)  # shares of flights whose minimum margin is estimated
_STRAIGHT: Final = 1e-9  # a quotient of shape and scale below which the law is exponential
_WORST: Final = 1e6
_SPAN: Final = 12.0  # of the logarithm of how far the largest excess is from the end of the law


class NoFitError(ValueError):
    """Margins that no tail can be fitted to, in one sentence."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number and its interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TailFit:
    """A generalised Pareto law of margins below a threshold."""

    flights: int  # with a margin
    tail: int  # of them below the threshold
    threshold_m: float
    shape: Estimate  # below 0: there is a minimum margin
    scale_m: Estimate
    anderson_darling: float
    goodness: float  # share of tails of the fitted law that fit no better [1]
    refits: int
    confidence: float  # of all intervals here
    below_zero: Estimate | None  # probability of a margin below 0; None: 0 is above the threshold
    margins_m: tuple[tuple[float, Estimate], ...]  # that a share of flights stays below
    end_m: Estimate | None  # least possible margin; None: the law has none

    @property
    def fits(self) -> bool:
        """Whether the law is not rejected."""
        return self.goodness >= REJECTED


def fit_tail(
    margins: Sequence[float], confidence: float, refits: int = 399, seed: int = 0
) -> TailFit:
    """Fit the lower tail of least ``margins`` [m], intervals at a ``confidence`` [1].

    Goodness is a parametric bootstrap of the Anderson-Darling statistic: ``refits`` tails of the
    fitted law, each fitted anew. The intervals are profile likelihoods, see ``pareto_intervals``.

    Raises:
        NoFitError: Too few flights, or margins that do not vary.
    """
    from scipy.stats import genpareto

    ordered = np.sort(np.asarray(margins, dtype=np.float64))
    total, tail = len(ordered), max(_MIN_TAIL, math.ceil(_TAIL_SHARE * len(ordered)))
    if total < MIN_FLIGHTS:
        raise NoFitError(
            f"{total} flights have a margin: a tail needs at least {MIN_FLIGHTS}, so no "
            "extreme-value law is fitted"
        )
    if not np.isfinite(ordered).all():
        raise NoFitError("a margin is not finite, so no extreme-value law is fitted")
    threshold = float(ordered[tail])
    excess = threshold - ordered[:tail]
    distinct = len(np.unique(excess[excess > 0.0]))
    if distinct < _MIN_DISTINCT:
        raise NoFitError(
            f"only {distinct} different margins are below the threshold of "
            f"{1e3 * threshold:.1f} mm: flights that are too much alike have no tail, so no "
            "extreme-value law is fitted"
        )
    # Scaled: the search for the maximum knows no millimetres.
    unit = float(excess.mean())
    excess = excess / unit
    shape, scale = law = most_likely(excess)
    statistic = anderson_darling(excess, *law)
    random = np.random.default_rng(seed)
    simulated = genpareto.rvs(shape, scale=scale, size=(refits, tail), random_state=random)
    worse = sum(anderson_darling(one, *most_likely(one)) >= statistic for one in simulated)
    intervals = Intervals(excess, total, law, confidence, simulated[:_MAX_SCALED], random)

    def length(ends: tuple[float, float, float]) -> Estimate:
        return Estimate(*(unit * one for one in ends))

    def margin(ends: tuple[float, float, float]) -> Estimate:
        value, low, high = (threshold - unit * one for one in ends)
        return Estimate(value, high, low)

    return TailFit(
        flights=total,
        tail=tail,
        threshold_m=threshold,
        shape=Estimate(*intervals.of(SHAPE)),
        scale_m=length(intervals.of(SCALE)),
        anderson_darling=statistic,
        goodness=(1 + worse) / (1 + refits),
        refits=refits,
        confidence=confidence,
        below_zero=Estimate(*intervals.of(beyond(threshold / unit))) if threshold > 0.0 else None,
        margins_m=tuple(
            (rare, margin(intervals.of(depth(rare)))) for rare in RARE if rare < tail / total
        ),
        end_m=margin(intervals.of(END)) if shape < 0.0 else None,
    )


def anderson_darling(excess: Array, shape: float, scale: float) -> float:
    """The Anderson-Darling statistic [1] of the ``excess`` (n,) [any unit] under a law.

    The law has a ``shape`` [1] and a ``scale`` [any unit].

    Source: Anderson, Darling: A test of goodness of fit, JASA 49, 1954.
    """
    from scipy.stats import genpareto

    ordered = np.sort(excess)
    count = len(ordered)
    weights = 2.0 * np.arange(1, count + 1) - 1.0
    below = genpareto.logcdf(ordered, shape, scale=scale)
    above = genpareto.logsf(ordered[::-1], shape, scale=scale)
    return float(-count - (weights * (below + above)).sum() / count)


def most_likely(excess: Array) -> tuple[float, float]:
    """Shape [1] and scale [excess] of the most likely law of the ``excess`` (n,) [any unit].

    For a given quotient of the two, shape and likelihood are closed expressions, so the maximum is
    one of a single number. Shapes below -1 have no maximum and are left out.

    Source: Grimshaw: Computing maximum likelihood estimates for the generalized Pareto
    distribution, Technometrics 35, 1993.
    """
    from scipy.optimize import minimize_scalar

    most, mean = float(excess.max()), float(excess.mean())

    def cost(place: float) -> float:
        quotient = math.expm1(place) / most
        shape = float(np.log1p(quotient * excess).mean())
        if shape < -1.0:
            return _WORST
        scale = shape / quotient if abs(quotient) * mean > _STRAIGHT else mean
        return math.log(scale) + shape

    grid = np.linspace(-_SPAN, _SPAN, 49)
    best = int(np.argmin([cost(float(place)) for place in grid]))
    ends = (grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)])
    place = minimize_scalar(cost, bounds=ends, method="bounded", options={"xatol": 1e-7}).x
    quotient = math.expm1(float(place)) / most
    shape = float(np.log1p(quotient * excess).mean())
    return shape, shape / quotient if abs(quotient) * mean > _STRAIGHT else mean
