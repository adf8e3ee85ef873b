"""The ends of an interval are where another search for the most likely law finds them too."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import binom, genpareto

from studies.statistics.extremes import Array, fit_tail, most_likely
from studies.statistics.pareto_intervals import SCALE, SHAPE, Likelihood, Quantity, beyond, depth

TOTAL, FALL, RARE, FAR = 400, 3.84, 1e-3, 6.0


def tail(shape: float, seed: int) -> Array:
    """Forty excesses of a scale of 1."""
    found: Array = genpareto.rvs(shape, size=40, random_state=np.random.default_rng(seed))
    return found


def log_likelihood(excess: Array, shape: float, scale: float, share: float) -> float:
    """Of the excesses and of how many there are."""
    if not (0.0 < share < 1.0 and scale > 0.0 and shape >= -1.0):
        return -math.inf
    found = float(genpareto.logpdf(excess, shape, scale=scale).sum())
    return found + float(binom.logpmf(len(excess), TOTAL, share))


def scale_of(name: str, value: float, shape: float, share: float) -> float:
    """The scale of a law that has this value; found from scipy's law, not from ours."""
    if name == "depth":  # which is proportional to the scale
        return value / float(genpareto.isf(RARE / share, shape))
    if name == "beyond":
        return FAR / float(genpareto.isf(value / share, shape))
    return value


def fall(name: str, excess: Array, value: float) -> float:
    """By how much twice the logarithm falls, by a search over all laws with the value."""
    law = most_likely(excess)
    most = log_likelihood(excess, *law, len(excess) / TOTAL)

    def cost(place: Array) -> float:
        free, share = place.tolist()  # of shape and scale, the one that the value leaves free
        mine = (value, free) if name == "shape" else (free, scale_of(name, value, free, share))
        return -log_likelihood(excess, *mine, share)

    frees = (0.5, 1.0, 2.0) if name == "shape" else law[0] + np.array((-0.3, 0.0, 0.3, 0.6))
    begins = [(float(free), 0.1) for free in frees]
    options = {"xatol": 1e-4, "fatol": 1e-5, "maxiter": 2000}
    with np.errstate(all="ignore"):
        found = min(
            minimize(cost, begin, method="Nelder-Mead", options=options).fun
            for begin in begins
            if math.isfinite(cost(np.array(begin)))
        )
    return 2.0 * (most + found)


@pytest.mark.drawn(4)
@pytest.mark.parametrize(
    ("name", "quantity"),
    [("shape", SHAPE), ("scale", SCALE), ("depth", depth(RARE)), ("beyond", beyond(FAR))],
)
@pytest.mark.parametrize("shape", [-0.2, 0.2])
def test_the_likelihood_has_fallen_that_far_at_both_ends(
    name: str, quantity: Quantity, shape: float
) -> None:
    excess = tail(shape, 5)
    mine = Likelihood(excess, TOTAL)
    for end in mine.interval(quantity, FALL):
        if end <= 0.0 and name == "beyond":
            continue  # laws that end before are likely enough
        assert fall(name, excess, end) == pytest.approx(FALL, abs=0.03)
        assert mine.fall(quantity, end) == pytest.approx(FALL, abs=0.08)


def test_the_end_of_the_law_is_between_the_ends_of_its_interval() -> None:
    excess = tail(-0.4, 2)
    mine = Likelihood(excess, TOTAL)
    low, high = mine.interval_of_end(FALL)
    assert excess.max() <= low < high
    assert mine.fall_of_end(low) == pytest.approx(FALL, abs=1e-6)
    if math.isfinite(high):
        assert mine.fall_of_end(high) == pytest.approx(FALL, abs=1e-6)
    shape, scale = most_likely(excess)
    assert mine.fall_of_end(-scale / shape) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.long
def test_the_interval_of_a_rare_margin_holds_nearly_as_often_as_it_says() -> None:
    shape, held = -0.2, 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        excess = genpareto.rvs(shape, scale=0.01, size=400, random_state=random)
        fit = fit_tail((0.1 - excess).tolist(), 0.95, refits=4, seed=seed)
        estimate = dict(fit.margins_m)[1e-3]
        held += estimate.low <= 0.1 - genpareto.isf(1e-3, shape, scale=0.01) <= estimate.high
    assert held >= 35  # 38 expected
