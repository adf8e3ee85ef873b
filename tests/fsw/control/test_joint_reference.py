"""Whatever is wanted of the joints, they are asked for angles and rates within their limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fsw.control.joint_reference import (
    APPROACH,
    JointReferenceLimits,
    bounds,
    joint_reference,
    within_limits,
)
from fsw.model.airframe import AIRFRAME
from fsw.signals import Vec2

LIMITS = JointReferenceLimits()
DT = 0.002
ANGLES = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
RATES = st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
ROUNDING = 1e-12


def assert_within(q: Vec2, qd: Vec2) -> None:
    first, both = bounds(AIRFRAME, LIMITS)
    assert first < AIRFRAME.joint1_limit
    assert both < AIRFRAME.joint12_limit
    assert abs(q[0]) <= first + ROUNDING
    assert abs(q[0] + q[1]) <= both + ROUNDING
    assert max(map(abs, qd)) <= LIMITS.rate + ROUNDING
    assert LIMITS.rate < AIRFRAME.joint_rate_max


@pytest.mark.requirement("REQ-ACT-8")
@given(ANGLES, ANGLES, RATES)
@settings(max_examples=500)
def test_no_wish_leads_out_of_the_limits_in_angle_or_rate(last: Vec2, q: Vec2, qd: Vec2) -> None:
    reached, rates = joint_reference(AIRFRAME, LIMITS, last, (q, qd), DT)
    assert_within(reached, rates)
    # From a reference that was within them, no joint is asked to jump.
    start = within_limits(AIRFRAME, LIMITS, last)
    assert max(abs(reached[0] - start[0]), abs(reached[1] - start[1])) <= LIMITS.rate * DT + 1e-12


@given(ANGLES, ANGLES, RATES)
@settings(max_examples=500)
def test_at_a_limit_nothing_is_asked_to_go_on_towards_it(last: Vec2, q: Vec2, qd: Vec2) -> None:
    """A reference that moves at its rate for a joint loop's moment is still within the limits."""
    reached, rates = joint_reference(AIRFRAME, LIMITS, last, (q, qd), DT)
    moment = 1.0 / APPROACH
    first, both = bounds(AIRFRAME, LIMITS)
    assert abs(reached[0] + moment * rates[0]) <= first + 1e-9
    assert abs(sum(reached) + moment * sum(rates)) <= both + 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_a_wish_that_jumps_about_is_followed_within_the_limits(seed: int) -> None:
    random, last = np.random.default_rng(seed), (0.2, -0.4)
    for k in range(2000):
        if k % 50 == 0:
            wanted = (float(random.uniform(-3.0, 3.0)), float(random.uniform(-3.0, 3.0)))
        reached, rates = joint_reference(AIRFRAME, LIMITS, last, (wanted, (9.0, -9.0)), DT)
        assert_within(reached, rates)
        assert max(map(abs, np.subtract(reached, last))) <= LIMITS.rate * DT + 1e-12
        last = reached


def test_a_wish_within_the_limits_is_granted_at_once_and_as_it_is() -> None:
    q, qd = (0.301, -0.402), (0.5, -1.0)
    assert joint_reference(AIRFRAME, LIMITS, (0.3, -0.4), (q, qd), DT) == (q, qd)


def test_a_far_wish_is_reached_on_the_straight_way_and_at_the_most_allowed_rate() -> None:
    last: Vec2 = (-0.5, 0.9)
    goal: Vec2 = (0.5, -0.3)
    for k in range(1, 400):
        last, rates = joint_reference(AIRFRAME, LIMITS, last, (goal, (0.0, 0.0)), DT)
        if last == goal:
            break
        # Second joint: 1.2 rad, the first 1.0.
        assert last[1] == pytest.approx(0.9 - k * LIMITS.rate * DT)
        assert (last[0] + 0.5) / 1.0 == pytest.approx((0.9 - last[1]) / 1.2)
        assert rates == pytest.approx((LIMITS.rate / 1.2, -LIMITS.rate))
    assert k == math.ceil(1.2 / (LIMITS.rate * DT))


def test_a_wider_margin_keeps_farther_off() -> None:
    wide = replace(LIMITS, margin=0.2)
    q = within_limits(AIRFRAME, wide, (2.0, 2.0))
    assert q[0] == pytest.approx(AIRFRAME.joint1_limit - 0.2)
    assert sum(q) == pytest.approx(AIRFRAME.joint12_limit - 0.2)
