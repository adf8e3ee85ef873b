"""The safe speed S(d): smooth, monotone, and never more than the vehicle can brake from."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fsw.autopilot.barriers.barrier_function import cbf_lower_bound
from fsw.autopilot.barriers.safe_approach import (
    LOUD,
    BarrierTuning,
    safe_approach_slope,
    safe_approach_speed,
)

alphas = st.floats(0.1, 10.0)
slopes = st.floats(0.5, 10.0)
distances = st.floats(-2.0, 5.0)


@given(distances, alphas, slopes)
def test_never_above_the_true_root(d: float, alpha: float, slope: float) -> None:
    assume(d >= 0.0)
    assert safe_approach_speed(d, alpha, slope) <= math.sqrt(2.0 * alpha * d) + 1e-12


@given(distances, alphas, slopes)
def test_outside_the_set_only_speeds_back_in_are_safe(d: float, alpha: float, slope: float) -> None:
    assume(d < -1e-9)
    assert safe_approach_speed(d, alpha, slope) < 0.0


@given(distances, st.floats(1e-6, 1.0), alphas, slopes)
def test_more_room_allows_more_speed(d: float, more: float, alpha: float, slope: float) -> None:
    assert safe_approach_speed(d + more, alpha, slope) > safe_approach_speed(d, alpha, slope)


@given(alphas, slopes)
def test_value_and_slope_are_continuous_where_line_and_root_meet(
    alpha: float, slope: float
) -> None:
    knee = alpha / slope**2
    below, above = knee * (1.0 - 1e-9), knee * (1.0 + 1e-9)
    assert safe_approach_speed(below, alpha, slope) == pytest.approx(
        safe_approach_speed(above, alpha, slope), rel=1e-7
    )
    assert safe_approach_slope(below, alpha, slope) == pytest.approx(
        safe_approach_slope(above, alpha, slope), rel=1e-7
    )


@given(distances, alphas, slopes)
def test_slope_is_the_finite_difference_and_never_above_its_bound(
    d: float, alpha: float, slope: float
) -> None:
    step = 1e-6
    difference = (
        safe_approach_speed(d + step, alpha, slope) - safe_approach_speed(d - step, alpha, slope)
    ) / (2.0 * step)
    assert safe_approach_slope(d, alpha, slope) == pytest.approx(difference, rel=1e-3, abs=1e-6)
    assert 0.0 < safe_approach_slope(d, alpha, slope) <= slope


@given(st.floats(0.001, 4.0), alphas, slopes)
def test_braking_at_alpha_from_the_safe_speed_stops_inside(
    d: float, alpha: float, slope: float
) -> None:
    assert safe_approach_speed(d, alpha, slope) ** 2 / (2.0 * alpha) <= d + 1e-9


@given(
    h_start=st.floats(-3.0, 3.0),
    node=st.integers(0, 8),
    gamma=st.floats(0.5, 10.0),
    robustness=st.floats(0.05, 1.0),
)
def test_required_h_is_the_one_step_condition_iterated(
    h_start: float, node: int, gamma: float, robustness: float
) -> None:
    period, h = 0.1, h_start
    for _ in range(node):  # h' + gamma (h - lambda) = 0 over one sample
        h -= gamma * period * (h - robustness)
    tuning = BarrierTuning(gamma=gamma, lambda_=robustness, slope=1.0)
    assert cbf_lower_bound(h_start, node, tuning.numbers(period)) == pytest.approx(h, abs=1e-12)


@pytest.mark.parametrize("name", ["alpha", "slope", "gamma", "lambda_"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 0.0, -1.0])
def test_tuning_refuses_what_is_not_a_positive_number(name: str, value: float) -> None:
    build: Callable[..., Any] = BarrierTuning
    with pytest.raises(ValueError, match=name.strip("_")):
        build(**{name: value})


@pytest.mark.parametrize("name", ["slope", "gamma"])
def test_tuning_refuses_a_rate_too_fast_for_its_period(name: str) -> None:
    build: Callable[..., Any] = BarrierTuning
    build(**{name: 10.0}).check_sampling(0.1)
    with pytest.raises(ValueError, match=name.strip("_")):
        build(**{name: 10.1}).check_sampling(0.1)


@pytest.mark.parametrize("period", [0.05, 0.25])
def test_a_rate_too_fast_is_refused_with_the_fastest_that_is_not(period: float) -> None:
    most = 1.0 / period
    BarrierTuning(slope=most, gamma=most).check_sampling(period)
    with pytest.raises(ValueError, match=rf"must not exceed {most} 1/s"):
        BarrierTuning(slope=1.01 * most, gamma=most).check_sampling(period)
    with pytest.raises(ValueError, match=rf"gamma is .*; .* must not exceed {most} 1/s"):
        BarrierTuning(slope=most, gamma=1.01 * most).check_sampling(period)


@given(st.floats(0.0, 2.0), st.floats(0.0, 0.5))
def test_lambda_that_follows_is_never_below_its_least_nor_above_itself(
    recent: float, least: float
) -> None:
    tuning = BarrierTuning(lambda_=0.35)
    found = tuning.following(recent, least)
    assert min(least or 0.35, 0.35) <= found <= 0.35
    if recent >= LOUD:
        assert found == 0.35


@pytest.mark.parametrize("recent", [math.inf, math.nan, 5.0])
def test_lambda_is_whole_where_nothing_is_known_of_the_disturbance(recent: float) -> None:
    assert BarrierTuning(lambda_=0.35).following(recent, 0.2) == 0.35


@pytest.mark.parametrize("least", [0.0, 0.35, 0.9])
def test_lambda_does_not_follow_where_there_is_no_lower_one(least: float) -> None:
    assert BarrierTuning(lambda_=0.35).following(0.0, least) == 0.35
