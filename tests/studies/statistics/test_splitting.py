"""Splitting against probabilities that are known, and against plain counting."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2, norm

from studies.statistics.splitting import (
    Array,
    Effort,
    Estimate,
    Score,
    Space,
    estimate,
    mean_of_lognormal,
)

MILLIONTH = 1e-6
BUDGET = 20_000  # evaluations of all runs of an estimate together


def plane(probability: float) -> Score:
    """A point is in the event if it is beyond a plane: the distance is normal."""
    beyond = -norm.ppf(probability)
    return lambda z: beyond - z.sum(axis=1) / math.sqrt(z.shape[1])


def shell(probability: float, dimension: int) -> Score:
    """If it is far from the origin: the square of the distance is chi-squared."""
    beyond = chi2.isf(probability, dimension)
    return lambda z: beyond - (z * z).sum(axis=1)


def slab(probability: float) -> Score:
    """If it is beyond one of two planes that are opposite each other."""
    beyond = -norm.ppf(0.5 * probability)
    return lambda z: beyond - np.abs(z.sum(axis=1)) / math.sqrt(z.shape[1])


PROBLEMS = {"plane": plane(MILLIONTH), "shell": shell(MILLIONTH, 60), "slab": slab(MILLIONTH)}


@cache
def estimates(problem: str, repetitions: int) -> tuple[Estimate, ...]:
    """Repetitions with the standard effort."""
    score, space = PROBLEMS[problem], Space(dimension=60)
    return tuple(estimate(score, space, 0.0, Effort(), 0.95, seed) for seed in range(repetitions))


def covered(found: tuple[Estimate, ...], truth: float) -> int:
    """Intervals with the truth in them."""
    return sum(one.interval[0] <= truth <= one.interval[1] for one in found)


@pytest.mark.long
def test_a_known_millionth_is_within_its_interval_in_nineteen_of_twenty() -> None:
    found = estimates("plane", 20)
    assert covered(found, MILLIONTH) >= 19
    assert max(one.evaluations for one in found) <= BUDGET
    widths = [one.interval[1] / one.interval[0] for one in found]
    assert np.median(widths) < 5.0  # and it says something
    assert not any(one.exact for one in found)


@pytest.mark.long
@pytest.mark.parametrize("problem", PROBLEMS)
def test_the_interval_holds_as_often_as_it_says(problem: str) -> None:
    found = estimates(problem, 400)
    assert covered(found, MILLIONTH) >= 371  # 380 expected, deviation 4.4
    assert max(one.evaluations for one in found) <= BUDGET
    mean = np.mean([one.probability for one in found])
    assert 0.95e-6 < mean < 1.25e-6  # the adaptive levels add some 10 % to the mean


def test_at_a_hundredth_it_agrees_with_plain_counting() -> None:
    score = slab(1e-2)
    found = estimate(score, Space(dimension=30), 0.0, Effort(), 0.99, 5)
    points = np.random.default_rng(6).standard_normal((100_000, 30))
    counted = float(np.mean(score(points) <= 0.0))
    assert found.interval[0] < counted < found.interval[1]
    assert found.interval[0] > 0.5e-2
    assert found.interval[1] < 2e-2
    assert all(len(run.levels) in (2, 3) for run in found.runs)


def test_an_event_that_is_not_rare_is_counted_with_the_exact_interval() -> None:
    found = estimate(plane(0.3), Space(dimension=5), 0.0, Effort(), 0.95, 1)
    assert found.exact
    assert found.evaluations == 3000
    assert found.interval[0] < 0.3 < found.interval[1]
    assert found.interval[1] - found.interval[0] < 0.04


def test_the_scatter_of_the_runs_shows_that_chains_are_correlated() -> None:
    found = estimates("plane", 20)
    assert 0.25 < np.mean([one.as_if_independent for one in found]) < 0.35
    ratio = np.mean([one.deviation / one.as_if_independent for one in found])
    assert 1.4 < ratio < 2.4


def seeded(z: Array) -> Array:
    """A number that can only be redrawn decides about a third, a plane about the rest."""
    lucky = norm.cdf(z[:, -1]) % 0.1 < 0.1 / 3.0
    scores: Array = plane(3e-4)(z[:, :-1])
    return np.where(lucky, scores, np.maximum(scores, 0.5))


def test_numbers_without_a_neighbourhood_are_drawn_anew() -> None:
    space = Space(dimension=21, redrawn=1)
    found = estimate(seeded, space, 0.0, Effort(), 0.95, 2)
    assert found.interval[0] < 1e-4 < found.interval[1]
    assert found.probability == pytest.approx(1e-4, rel=0.6)


def test_an_event_that_cannot_be_reached_is_no_number() -> None:
    flat = estimate(lambda z: np.ones(len(z)), Space(dimension=3), 0.0, Effort(), 0.95, 1)
    assert flat.reached == 0
    assert flat.probability == 0.0
    assert flat.interval == (0.0, 1.0)
    assert "stays at 1" in flat.runs[0].stuck
    few = Effort(levels=3)
    far = estimate(plane(1e-9), Space(dimension=3), 0.0, few, 0.95, 1)
    assert "after 3 levels" in far.runs[0].stuck
    assert far.interval == (0.0, 1.0)


def test_a_bounded_score_gets_stuck_at_its_bound() -> None:
    floor = estimate(
        lambda z: np.maximum(plane(1e-6)(z), 1.0), Space(dimension=3), 0.0, Effort(), 0.95, 1
    )
    assert floor.reached == 0
    assert all("stays at 1" in run.stuck for run in floor.runs)
    assert min(run.least for run in floor.runs) == 1.0


def test_the_same_seed_gives_the_same_and_the_least_point_has_its_score() -> None:
    score, space = plane(1e-3), Space(dimension=8)
    first, again = (estimate(score, space, 0.0, Effort(), 0.95, 9) for _ in range(2))
    assert first.probability == again.probability
    assert first.probability != estimate(score, space, 0.0, Effort(), 0.95, 10).probability
    for run in first.runs:
        assert score(run.point[None, :])[0] == run.least <= 0.0


def test_points_of_all_runs_are_asked_for_together() -> None:
    sizes: list[int] = []

    def score(z: Array) -> Array:
        sizes.append(len(z))
        return plane(1e-3)(z)

    found = estimate(score, Space(dimension=4), 0.0, Effort(particles=100, runs=4), 0.95, 1)
    assert sizes[0] == 400
    assert sum(sizes) == found.evaluations == sum(run.evaluations for run in found.runs)
    assert len(sizes) <= 40


def test_the_interval_of_a_lognormal_mean_covers_it() -> None:
    random, hits = np.random.default_rng(3), 0
    for _ in range(400):
        values = np.exp(random.normal(-14.0, 0.7, 10))
        (low, high), _ = mean_of_lognormal(values, 0.95)
        hits += low <= math.exp(-14.0 + 0.5 * 0.7**2) <= high
    assert 371 <= hits <= 395


@pytest.mark.parametrize("wrong", [{"particles": 40}, {"runs": 1}, {"share": 0.6}])
def test_an_effort_that_cannot_work_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must be at least 50|needs 2 runs"):
        Effort(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("values", [(1e-3, 6e-3), (1e-9, 0.5), (1e-300, 1e-3)])
@pytest.mark.parametrize("confidence", [0.5, 0.999])
def test_an_interval_too_wide_for_a_float_ends_at_1(
    values: tuple[float, float], confidence: float
) -> None:
    (low, high), deviation = mean_of_lognormal(np.array(values), confidence)
    assert 0.0 <= low <= high <= 1.0
    assert deviation == pytest.approx(np.log(values).std(ddof=1))


def test_the_interval_of_five_runs_holds_as_often_as_the_page_says() -> None:
    random = np.random.default_rng(1)
    for scatter, share in ((0.3, 0.94), (0.8, 0.94), (1.5, 0.91)):
        logs = -20.0 + scatter * random.standard_normal((1000, 5))
        truth = math.exp(-20.0 + 0.5 * scatter**2)
        ends = [mean_of_lognormal(np.exp(one), 0.95)[0] for one in logs]
        held = np.mean([low <= truth <= high for low, high in ends])
        assert held == pytest.approx(share, abs=0.025)
