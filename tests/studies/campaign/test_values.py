"""Distributions and designs: what each flight gets."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from studies.campaign.values import (
    Choice,
    Design,
    Normal,
    Uniform,
    design_point,
    drawn,
    grid_point,
    grid_size,
    seed_of,
)


def test_a_seed_is_that_of_numpys_spawned_sequence() -> None:
    words = np.random.SeedSequence(7, spawn_key=(12,)).generate_state(1, np.uint64)
    assert seed_of(7, 12) == int(words[0]) >> 1
    assert len({seed_of(7, k) for k in range(1000)}) == 1000
    assert seed_of(7, 0) != seed_of(8, 0)
    assert seed_of(7, 0) < 1 << 63


def test_values_of_a_flight_are_not_its_seeds_numbers() -> None:
    own = np.random.default_rng(np.random.SeedSequence(7, spawn_key=(12,))).random(3)
    assert drawn(7, 12, 3) != pytest.approx(own)
    assert drawn(7, 12, 3) == drawn(7, 12, 4)[:3]


def test_uniform_and_choice_cover_their_range() -> None:
    assert [Uniform(2.0, 4.0).at(share) for share in (0.0, 0.5)] == [2.0, 3.0]
    assert Uniform(2.0, 4.0, 3).grid() == (2.0, 3.0, 4.0)
    assert [Choice((1.0, 5.0)).at(share) for share in (0.0, 0.49, 0.5, 1.0)] == [1, 1, 5, 5]


def test_a_normal_is_scipys_cut_off_normal() -> None:
    ours, theirs = Normal(1.0, 0.2, 0.9, 1.6), stats.truncnorm(-0.5, 3.0, 1.0, 0.2)
    for share in (0.0, 0.01, 0.3, 0.5, 0.99, 1.0):
        assert ours.at(share) == pytest.approx(theirs.ppf(share), abs=1e-9)
    grid = Normal(1.0, 0.2, 0.0, 2.0, 4).grid()
    assert grid == pytest.approx(stats.norm(1.0, 0.2).ppf([0.125, 0.375, 0.625, 0.875]), abs=1e-5)


def test_a_grid_has_every_combination_once_and_then_again() -> None:
    varied = (Choice((1.0, 2.0)), Uniform(0.0, 1.0, 3))
    assert grid_size(varied) == 6
    points = [grid_point(varied, k) for k in range(12)]
    assert len(set(points[:6])) == 6
    assert points[:2] == [(1.0, 0.0), (1.0, 0.5)]
    assert points[6:] == points[:6]


@pytest.mark.parametrize("design", ["sobol", "latin-hypercube"])
def test_a_point_depends_on_nothing_but_its_number(design: Design) -> None:
    backwards = [design_point(design, 5, 1, k, 2000, 3) for k in (1999, 700, 0)]
    forwards = [design_point(design, 5, 1, k, 2000, 3) for k in (0, 700, 1999)]
    assert backwards == forwards[::-1]
    assert design_point(design, 5, 2, 0, 2000, 3) != forwards[0]
    assert design_point(design, 6, 1, 0, 2000, 3) != forwards[0]


@pytest.mark.parametrize("design", ["sobol", "latin-hypercube"])
def test_a_design_fills_every_interval_of_each_key(design: Design) -> None:
    points = np.array([design_point(design, 5, 0, k, 64, 3) for k in range(64)])
    for column in points.T:
        assert sorted(int(64 * share) for share in column) == list(range(64))
