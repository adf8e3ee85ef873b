"""A tail whose law is known is found again; margins without a tail are refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import genpareto, goodness_of_fit

from studies.statistics.extremes import (
    Array,
    NoFitError,
    TailFit,
    anderson_darling,
    fit_tail,
    most_likely,
)


def margins(shape: float, count: int, seed: int) -> Array:
    """A tenth below 0.1 m by a law of scale 8 mm, the others above."""
    random = np.random.default_rng(seed)
    tail = count // 10
    below = 0.1 - genpareto.rvs(shape, scale=0.008, size=tail, random_state=random)
    found: Array = np.concatenate((below, random.uniform(0.1, 0.15, count - tail)))
    return found


@pytest.mark.parametrize("shape", [-0.25, pytest.param(0.15, marks=pytest.mark.long)])
def test_the_law_of_a_tail_is_within_its_interval(shape: float) -> None:
    found = fit_tail(margins(shape, 2000, 4).tolist(), 0.99, refits=39)
    assert found.tail == 200
    assert found.threshold_m == pytest.approx(0.1, abs=2e-4)
    assert found.shape.low <= shape <= found.shape.high
    assert found.scale_m.low <= 0.008 <= found.scale_m.high
    assert found.fits
    truth = 0.1 * genpareto.sf(0.1, shape, scale=0.008)
    assert found.below_zero is not None
    assert found.below_zero.low <= truth <= found.below_zero.high
    for share, margin in found.margins_m:
        assert margin.low <= 0.1 - genpareto.isf(10.0 * share, shape, scale=0.008) <= margin.high
    assert (found.end_m is None) == (found.shape.value >= 0.0)
    if found.end_m is not None:
        assert found.end_m.low <= 0.1 - 0.008 / 0.25 <= found.end_m.high


def test_two_kinds_of_flight_are_no_one_tail() -> None:
    random = np.random.default_rng(1)
    close, far = random.uniform(0.0, 0.01, 40), random.uniform(0.09, 0.1, 60)
    mixed = np.concatenate((close, far, random.uniform(0.1, 0.2, 900)))
    found = fit_tail(mixed.tolist(), 0.95, refits=24)
    assert not found.fits
    assert found.goodness == pytest.approx(1.0 / 25.0)


def test_the_statistic_is_that_of_another_implementation() -> None:
    excess = genpareto.rvs(0.1, scale=2.0, size=60, random_state=np.random.default_rng(3))
    other = goodness_of_fit(
        genpareto, excess, known_params={"loc": 0.0}, statistic="ad", n_mc_samples=1
    )
    law = other.fit_result.params
    assert anderson_darling(excess, law.c, law.scale) == pytest.approx(other.statistic, rel=1e-9)


@pytest.mark.parametrize("shape", [-0.6, -0.2, 0.0, 0.4])
def test_no_other_search_finds_a_likelier_law(shape: float) -> None:
    for seed in range(3):
        random = np.random.default_rng(seed)
        excess = genpareto.rvs(shape, scale=2.0, size=80, random_state=random)
        other, _, scale = genpareto.fit(excess, floc=0.0)
        mine = genpareto.logpdf(excess, most_likely(excess)[0], scale=most_likely(excess)[1]).sum()
        theirs = genpareto.logpdf(excess, other, scale=scale).sum()
        assert mine >= theirs - 1e-6
        if other > -1.0:
            assert most_likely(excess) == pytest.approx((other, scale), abs=2e-3)


def refusal(values: list[float]) -> str:
    """Why no law is fitted."""
    with pytest.raises(NoFitError) as refused:
        fit_tail(values, 0.95, refits=1)
    return str(refused.value)


def test_few_flights_or_flights_that_are_all_alike_are_refused() -> None:
    assert "99 flights have a margin: a tail needs at least 100" in refusal(
        [0.1 + 1e-3 * k for k in range(99)]
    )
    assert "only 0 different margins" in refusal([0.1] * 500)
    assert "only 1 different margins" in refusal([0.1, 0.2] * 250 + [0.05] * 10)
    assert "not finite" in refusal([float("nan")] + [0.1 + 1e-3 * k for k in range(200)])


@pytest.mark.long
def test_the_intervals_and_the_goodness_hold_as_often_as_they_say() -> None:
    found: list[TailFit] = [
        fit_tail(margins(-0.2, 1000, seed).tolist(), 0.9, refits=99) for seed in range(40)
    ]
    shapes = sum(one.shape.low <= -0.2 <= one.shape.high for one in found)
    assert shapes >= 32  # of 40: nine in ten, less twice the deviation
    assert 27 <= sum(one.goodness >= 0.2 for one in found) <= 37  # four in five, the same
