"""The reference between, before and after the points that arrived."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.mpc.reference import KEPT_POINTS, merge, sample, still_at, vertical_ramp
from fsw.autopilot.signals import EndEffectorTarget, Vec3

STILL: Vec3 = (0.0, 0.0, 0.0)
small = st.floats(-3.0, 3.0)
vectors = st.tuples(small, small, small)


def point(t_us: int, p: Vec3 = STILL, v: Vec3 = STILL, yaw: float = 0.0) -> EndEffectorTarget:
    return EndEffectorTarget(t_us, p, v, STILL, yaw)


@given(vectors, vectors, vectors, vectors, st.integers(10_000, 500_000))
def test_curve_passes_through_both_points_with_their_velocities(
    p0: Vec3, v0: Vec3, p1: Vec3, v1: Vec3, span_us: int
) -> None:
    stream = (point(1_000, p0, v0), point(1_000 + span_us, p1, v1))
    first, last = sample(stream, 1_000), sample(stream, 1_000 + span_us)
    assert first.p_WE == pytest.approx(p0)
    assert first.v_WE == pytest.approx(v0, abs=1e-9)
    assert (last.p_WE, last.v_WE) == (p1, v1)
    # The end is also approached, not only stored.
    before_end = sample((*stream, point(2_000_000)), 1_000 + span_us - 1)
    assert before_end.p_WE == pytest.approx(p1, abs=2e-3)


@given(vectors, vectors, vectors, vectors, st.floats(0.05, 0.95))
def test_velocity_and_acceleration_are_derivatives_of_the_position(
    p0: Vec3, v0: Vec3, p1: Vec3, v1: Vec3, share: float
) -> None:
    stream = (point(0, p0, v0), point(1_000_000, p1, v1))
    t, step = round(share * 1e6), 1_000
    before, here, after = (sample(stream, t + k * step) for k in (-1, 0, 1))
    for axis in range(3):
        rate = (after.p_WE[axis] - before.p_WE[axis]) / (2e-6 * step)
        bend = (after.v_WE[axis] - before.v_WE[axis]) / (2e-6 * step)
        assert here.v_WE[axis] == pytest.approx(rate, abs=1e-3)
        assert here.a_WE[axis] == pytest.approx(bend, abs=1e-3)


def test_the_sample_is_stamped_with_the_instant_asked_for() -> None:
    stream = (point(0), point(100_000, (1.0, 0.0, 0.0)))
    assert [sample(stream, t).t_us for t in (-5, 0, 50_000, 100_000, 200_000)] == [
        -5,
        0,
        50_000,
        100_000,
        200_000,
    ]


def test_beyond_its_ends_the_reference_is_at_rest_there() -> None:
    stream = (point(100, (1.0, 2.0, 3.0), (1.0, 1.0, 1.0)), point(200, (4.0, 5.0, 6.0), STILL))
    for t, place in ((50, (1.0, 2.0, 3.0)), (250, (4.0, 5.0, 6.0))):
        there = sample(stream, t)
        assert there.p_WE == place
        assert there.v_WE == there.a_WE == STILL


def test_points_are_kept_in_order_of_time_however_they_arrive() -> None:
    stream = merge((point(300), point(500)), (point(400), point(200), point(600)), now_us=250)
    assert [p.t_us for p in stream] == [200, 300, 400, 500, 600]


def test_a_later_point_for_the_same_instant_wins() -> None:
    stream = merge((point(300, (1.0, 0.0, 0.0)),), (point(300, (2.0, 0.0, 0.0)),), now_us=0)
    assert [p.p_WE[0] for p in stream] == [2.0]
    both = merge((), (point(300, (1.0, 0.0, 0.0)), point(300, (2.0, 0.0, 0.0))), now_us=0)
    assert [p.p_WE[0] for p in both] == [2.0]


def test_points_that_are_past_are_forgotten_but_for_the_one_being_left() -> None:
    stream = merge((point(100), point(200), point(300)), (point(400),), now_us=250)
    assert [p.t_us for p in stream] == [200, 300, 400]
    assert [p.t_us for p in merge(stream, (point(500),), now_us=10_000)] == [500]


@given(st.lists(st.integers(0, 10**9), max_size=600), st.integers(0, 10**9))
def test_a_flood_of_points_is_bounded_and_ordered(times: list[int], now_us: int) -> None:
    stream = merge((), tuple(point(t) for t in times), now_us)
    assert len(stream) <= KEPT_POINTS
    assert all(a.t_us < b.t_us for a, b in itertools.pairwise(stream))


def test_a_flood_keeps_what_is_flown_next() -> None:
    flood = tuple(point(t) for t in range(0, 1000 * KEPT_POINTS, 500))
    assert merge((), flood, now_us=1_200)[:2] == (point(1_000), point(1_500))


@pytest.mark.parametrize("climb", [1.0, -1.0], ids=["up", "down"])
def test_ramp_moves_vertically_at_its_speed_and_then_rests(climb: float) -> None:
    start = still_at((1.0, 2.0, -0.5), 1_000_000, yaw=0.7)
    halfway = vertical_ramp(start, climb, 0.4, t_us=2_000_000)
    assert halfway.p_WE == pytest.approx((1.0, 2.0, -0.5 - math.copysign(0.4, climb)))
    assert halfway.v_WE == pytest.approx((0.0, 0.0, -math.copysign(0.4, climb)))
    arrived = vertical_ramp(start, climb, 0.4, t_us=9_000_000)
    assert arrived.p_WE == pytest.approx((1.0, 2.0, -0.5 - climb))
    assert arrived.v_WE == STILL
    before = vertical_ramp(start, climb, 0.4, t_us=0)
    assert before.p_WE == pytest.approx(start.p_WE)
    assert halfway.yaw == arrived.yaw == before.yaw == 0.7


def test_the_reference_turns_the_short_way() -> None:
    p = (0.0, 0.0, 0.0)
    stream = (EndEffectorTarget(0, p, p, p, 3.1), EndEffectorTarget(100_000, p, p, p, -3.1))
    assert abs(sample(stream, 50_000).yaw) > 3.0
