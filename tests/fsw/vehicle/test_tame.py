"""A streamed trajectory passes as it is unless it pulls wildly."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.signals import EndEffectorTarget, SafeSet, Vec3, Wall
from fsw.vehicle.tame import tamed

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


def kept(targets: tuple[EndEffectorTarget, ...], p_WE: Vec3) -> tuple[EndEffectorTarget, ...]:
    return tamed(targets, p_WE, WALL, 2.0, 4.0)


def test_the_paper_s_path_into_the_safety_zone_passes_untouched() -> None:
    targets = horizon((0.93, 0.0, -1.2), (0.1, 0.05, 0.0))
    assert kept(targets, (0.82, 0.0, -1.2)) is targets


def test_a_target_far_away_is_brought_to_the_leash_and_the_horizon_with_it() -> None:
    targets = horizon((-3.0, 4.0, -1.0), (0.0, 0.5, 0.0))
    near = kept(targets, (0.0, 0.0, -1.0))
    assert near[0].p_WE == pytest.approx((-0.3, 0.4, -1.0))
    for one, other in zip(targets, near, strict=True):
        assert other == replace(one, p_WE=pytest.approx(other.p_WE))
        moved = [a - b for a, b in zip(other.p_WE, one.p_WE, strict=True)]
        assert moved == pytest.approx([2.7, -3.6, 0.0])


@given(st.floats(-3.0, 0.9), st.floats(-5.0, 5.0), st.floats(-10.0, 10.0))
def test_nothing_pulls_deep_or_fast_into_a_wall(x: float, v: float, first: float) -> None:
    for target in kept(horizon((first, 0.0, -1.2), (v, 0.0, 0.0)), (x, 0.0, -1.2)):
        assert target.p_WE[0] <= 1.0 + 1e-9
        room = 0.9 - x
        assert target.v_WE[0] <= max((4.0 * room) ** 0.5, 4.0 * room, 0.5) + 1e-9
        assert target.v_WE[0] == v or v > 0.5
