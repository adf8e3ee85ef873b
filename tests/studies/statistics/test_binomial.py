"""The bounds are the binomial's own tails, and hold as often as they say."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from scipy.stats import binom, binomtest

from studies.statistics.binomial import bounds, flights_for, lower, upper

COUNTS = [(0, 1), (1, 1), (0, 300), (3, 300), (150, 300), (299, 300), (2, 10_000)]


def tail(count: int, total: int, p: float) -> float:
    """P(at most ``count`` of ``total``), summed term by term."""
    return math.fsum(
        math.exp(
            math.lgamma(total + 1)
            - math.lgamma(k + 1)
            - math.lgamma(total - k + 1)
            + k * math.log(p)
            + (total - k) * math.log1p(-p)
        )
        for k in range(count + 1)
    )


@pytest.mark.parametrize(("count", "total"), COUNTS)
@pytest.mark.parametrize("confidence", [0.5, 0.95, 0.999])
def test_at_its_bound_the_count_is_just_as_rare_as_the_confidence_says(
    count: int, total: int, confidence: float
) -> None:
    found = bounds(count, total, confidence)
    beyond = 1.0 - confidence
    if count < total:
        assert tail(count, total, found.upper) == pytest.approx(beyond, rel=1e-8)
        assert tail(count, total, found.interval[1]) == pytest.approx(0.5 * beyond, rel=1e-8)
    else:
        assert found.upper == found.interval[1] == 1.0
    if count > 0:
        assert 1.0 - tail(count - 1, total, found.lower) == pytest.approx(beyond, rel=1e-7)
    else:
        assert found.lower == found.interval[0] == 0.0


@pytest.mark.parametrize(("count", "total"), COUNTS)
def test_the_interval_is_that_of_another_implementation(count: int, total: int) -> None:
    other = binomtest(count, total).proportion_ci(0.99, method="exact")
    assert bounds(count, total, 0.99).interval == pytest.approx((other.low, other.high), rel=1e-9)


def test_no_violation_gives_the_closed_form() -> None:
    assert bounds(0, 2000, 0.95).upper == pytest.approx(1.0 - 0.05 ** (1.0 / 2000.0), rel=1e-12)
    assert flights_for(1e-3, 0.95) == 2995
    assert bounds(0, 2995, 0.95).upper <= 1e-3 < bounds(0, 2994, 0.95).upper


@pytest.mark.parametrize(("total", "p"), list(product([20, 150], [0.005, 0.03, 0.4])))
def test_the_bounds_cover_the_truth_at_least_as_often_as_promised(total: int, p: float) -> None:
    shares = binom.pmf(np.arange(total + 1), total, p)
    for beyond in (0.05, 0.01):
        above = sum(w for k, w in enumerate(shares) if p <= upper(k, total, beyond))
        below = sum(w for k, w in enumerate(shares) if p >= lower(k, total, beyond))
        assert 1.0 - beyond <= above <= 1.0
        assert 1.0 - beyond <= below <= 1.0 + 1e-12


def test_flights_of_unequal_probability_are_covered_as_well() -> None:
    """Cases that take turns: the bound is then one for the mean (Hoeffding, 1956)."""
    chances = np.tile((0.0, 0.02, 0.001, 0.1), 50)
    shares = np.ones(1)
    for p in chances:
        shares = np.convolve(shares, (1.0 - p, p))
    covered = sum(w for k, w in enumerate(shares) if chances.mean() <= upper(k, len(chances), 0.05))
    assert covered >= 0.95


@pytest.mark.parametrize(("count", "total", "confidence"), [(1, 0, 0.9), (3, 2, 0.9), (0, 5, 1.0)])
def test_what_is_no_count_is_refused(count: int, total: int, confidence: float) -> None:
    with pytest.raises(ValueError, match=r"no count|must be between"):
        bounds(count, total, confidence)
