"""A streamed trajectory passes as it is unless it pulls wildly."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.flight.reference_governor import limit_reference
from fsw.signals import EndEffectorTarget, PointObstacle, SafeSet, Vec3, Wall

WALL = SafeSet((Wall((-1.0, 0.0, 0.0), -1.0, 0.1),))
STILL: Vec3 = (0.0, 0.0, 0.0)


def horizon(first: Vec3, v: Vec3 = STILL) -> tuple[EndEffectorTarget, ...]:
    return tuple(
        EndEffectorTarget(
            100_000 * k,
            (first[0] + 0.1 * k * v[0], first[1] + 0.1 * k * v[1], first[2] + 0.1 * k * v[2]),
            v,
            STILL,
        )
        for k in range(6)
    )


def kept(
    targets: tuple[EndEffectorTarget, ...], p_WE: Vec3, v_WE: Vec3 = STILL
) -> tuple[EndEffectorTarget, ...]:
    return limit_reference(targets, p_WE, v_WE, WALL, 2.0, 4.0)


def test_the_paper_s_path_into_the_safety_zone_passes_untouched() -> None:
    targets = horizon((0.93, 0.0, -1.2), (0.1, 0.05, 0.0))
    assert kept(targets, (0.82, 0.0, -1.2)) is targets


def test_a_target_far_away_is_brought_near_and_no_node_jumps() -> None:
    near = kept(horizon((-3.0, 4.0, -1.0), (0.0, 0.5, 0.0)), (0.0, 0.0, -1.0))
    assert near[0].p_WE == pytest.approx((-0.24, 0.32, -1.0))
    assert math.dist(near[-1].p_WE, (0.0, 0.0, -1.0)) == pytest.approx(0.6)
    here = horizon((0.0, 0.0, -1.0))
    jumps = (*here[:3], *horizon((-2.0, 0.0, -1.0))[3:])
    near = kept(jumps, (0.0, 0.0, -1.0))
    assert max(math.dist(target.p_WE, (0.0, 0.0, -1.0)) for target in near) < 0.61


def test_a_vehicle_in_motion_may_be_asked_for_what_its_motion_leads_to() -> None:
    targets = horizon((-2.0, 0.0, -1.0), (0.0, 2.0, 0.0))
    assert kept(targets, (-2.0, 0.0, -1.0), (0.0, 1.8, 0.0)) is targets
    slower = kept(targets, (-2.0, 0.0, -1.0))
    assert slower[0].v_WE == pytest.approx((0.0, 1.0, 0.0))


@given(st.floats(-3.0, 0.9), st.floats(-5.0, 5.0), st.floats(-10.0, 10.0))
def test_nothing_pulls_deep_or_fast_into_a_wall(x: float, v: float, first: float) -> None:
    for target in kept(horizon((first, 0.0, -1.2), (v, 0.0, 0.0)), (x, 0.0, -1.2)):
        assert target.p_WE[0] <= 1.0 + 1e-9
        room = 0.9 - x
        assert target.v_WE[0] <= max((4.0 * room) ** 0.5, 4.0 * room, 0.5) + 1e-9
        assert abs(target.v_WE[0]) <= 1.0 + 1e-9


BRANCH = SafeSet(obstacles=(PointObstacle((1.0, 0.0, -1.2), 0.3),))


def test_a_path_that_passes_a_point_within_its_clearance_stays_as_it_is() -> None:
    targets = horizon((1.0, 0.25, -1.2), (0.3, 0.0, 0.0))
    assert limit_reference(targets, (0.9, 0.3, -1.2), STILL, BRANCH, 2.0, 4.0) is targets


@given(st.floats(-math.pi, math.pi), st.floats(0.01, 0.3), st.floats(0.5, 3.0))
def test_nothing_pulls_deep_into_the_ball_of_a_point_or_fast_towards_it(
    angle: float, distance: float, speed: float
) -> None:
    away = (math.cos(angle), math.sin(angle), 0.0)
    target = (1.0 + distance * away[0], distance * away[1], -1.2)
    p_WE = (1.0 + 0.35 * away[0], 0.35 * away[1], -1.2)
    inward = (-speed * away[0], -speed * away[1], 0.0)
    targets = (EndEffectorTarget(0, target, inward, STILL),)
    (tame,) = limit_reference(targets, p_WE, STILL, BRANCH, 2.0, 4.0)
    assert math.dist(tame.p_WE, (1.0, 0.0, -1.2)) == pytest.approx(max(distance, 0.2))
    assert math.hypot(*tame.v_WE) <= 0.5 + 1e-9
