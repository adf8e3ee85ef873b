"""The filter of the acceleration: when it changes nothing, and that it keeps off what it sees."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.barriers.margins import Margins
from fsw.barriers.safe_approach import BarrierTuning
from fsw.control.safety_filter import (
    NO_ZONES,
    FilterLaw,
    FilterTuning,
    filter_law,
    filtered,
    moving_zones,
)
from fsw.geometry.vectors import dot
from fsw.model.airframe import AIRFRAME
from fsw.model.body import body_of
from fsw.shapes.ball import ball
from fsw.shapes.half_space import wall
from fsw.shapes.target_sphere import target_sphere
from fsw.signals import EndEffectorTarget, SafeSet, StateEstimate, Vec3, Zone
from tests.fsw.random_states import estimate_of

ZERO: Vec3 = (0.0, 0.0, 0.0)
LAG = 0.11
TUNING = BarrierTuning()
STRICT = FilterTuning(allowance=0.0)
AHEAD = wall((-1.0, 0.0, 0.0), -1.0, 0.1)  # the vehicle must stay at x < 0.9


def law_of(body: str = "points", tuning: FilterTuning = STRICT, lag: float = LAG) -> FilterLaw:
    shape = body_of(body, AIRFRAME)  # type: ignore[arg-type]
    return filter_law(tuning, (TUNING, TUNING), shape, AIRFRAME.link_length, lag, 2.5)


LAW = law_of()


def at(p: Vec3, t_us: int = 0, rotation: Rotation | None = None) -> StateEstimate:
    return estimate_of(rotation or Rotation.identity(), p_WB=p)._replace(
        t_us=t_us, q_arm=(0.0, 0.0), w_WB_B=ZERO
    )


def asked(
    zones: tuple[Zone, ...], p: Vec3, v: Vec3, wanted: Vec3, a: Vec3 = ZERO, law: FilterLaw = LAW
) -> tuple[Vec3, bool, float]:
    return filtered(law, moving_zones(SafeSet(zones), None), at(p), v, a, wanted)


def least_needed(distance: float, rate: float, along: float = 0.0) -> float:
    """b of the law, by hand."""
    ahead, then = distance + LAG * rate + 0.5 * LAG**2 * along, rate + LAG * along
    knee = TUNING.alpha / TUNING.slope**2
    s = TUNING.slope * ahead
    slope = TUNING.slope
    if ahead >= knee:
        s = math.sqrt(2.0 * TUNING.alpha * (ahead - 0.5 * knee))
        slope = TUNING.alpha / s
    return -STRICT.gamma * (s + then) - slope * then


def test_without_zones_or_far_from_them_nothing_is_changed() -> None:
    wanted = (2.5, 0.1, -0.3)
    assert filtered(LAW, NO_ZONES, at(ZERO), ZERO, ZERO, wanted) == (wanted, False, math.inf)
    assert asked((AHEAD,), (0.2, 0.0, -1.0), ZERO, wanted) == (wanted, False, math.inf)
    assert moving_zones(SafeSet(), None) is NO_ZONES


def test_what_keeps_the_condition_passes_bit_for_bit() -> None:
    wanted = (-0.1234567891234, 0.3, 1.0)
    result, changed, margin = asked((AHEAD,), (0.6, 0.0, -1.0), (0.1, 0.4, 0.0), wanted)
    assert (result, changed) == (wanted, False)
    assert margin == pytest.approx(0.3)


@given(st.floats(0.5, 1.0), st.floats(-0.5, 1.0), st.floats(-2.5, 2.5), st.floats(-2.0, 2.0))
def test_towards_a_wall_it_is_the_nearest_that_keeps_the_condition(
    x: float, vx: float, ax: float, along: float
) -> None:
    wanted = (ax, 0.7, -0.4)
    result, changed, margin = asked((AHEAD,), (x, 0.0, -1.0), (vx, 0.2, 0.1), wanted, (along, 0, 0))
    assert margin == pytest.approx(0.9 - x)
    needed = least_needed(0.9 - x, -vx, -along)
    assert changed == (-ax < needed)
    assert result[1:] == wanted[1:], "along the normal only"
    assert -result[0] == pytest.approx(min(max(-ax, needed), 2.5) if changed else -ax)


@given(
    st.tuples(*[st.floats(-0.25, 0.25)] * 3),
    st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    st.tuples(*[st.floats(-2.5, 2.5)] * 3),
)
def test_several_zones_are_kept_at_once(p: Vec3, v: Vec3, wanted: Vec3) -> None:
    zones = (wall((-1.0, 0.0, 0.0), -0.3, 0.0), wall((0.0, 0.6, 0.8), -0.4, 0.0))
    result, _, _ = asked(zones, p, v, wanted)
    for zone in zones:
        n, distance = zone.shape.numbers[:3], 0.0
        distance = dot(n, p) - zone.shape.numbers[3]  # type: ignore[arg-type]
        needed = least_needed(distance, dot(n, v))  # type: ignore[arg-type]
        if max(map(abs, result)) < 2.49:
            assert dot(n, result) >= needed - 1e-3  # type: ignore[arg-type]


@pytest.mark.parametrize("speed", [0.0, 0.2, 0.5, 0.9])
@pytest.mark.parametrize("eager", [0.0, 1.0, 2.5])
def test_a_vehicle_that_is_driven_at_a_wall_stops_in_front_of_it(
    speed: float, eager: float
) -> None:
    """A base whose acceleration follows the filtered one after a lag."""
    dt, x, v, a = 0.002, 0.3, speed, 0.0
    changed_once = False
    for _ in range(3000):
        (ax, _, _), changed, _ = asked((AHEAD,), (x, 0.0, -1.0), (v, 0.0, 0.0), (eager, 0, 0),
                                       (a, 0.0, 0.0))  # fmt: skip
        changed_once |= changed
        a += dt / LAG * (ax - a)
        v += dt * a
        x += dt * v
        assert x < 0.9 + 1e-3
    assert changed_once == (speed > 0.0 or eager > 0.0)
    assert x > 0.8 or eager == 0.0, "and it comes as close as it may"


def test_a_part_of_the_body_is_kept_off_and_not_its_origin_alone() -> None:
    law, tilted = law_of("full"), Rotation.from_euler("xyz", (0.1, 0.2, 0.7))
    parts = body_of("full", AIRFRAME)
    margins = Margins(parts, AIRFRAME.link_length, (TUNING, TUNING), 0.1)
    for normal in ((-1.0, 0.0, 0.0), (0.6, 0.8, 0.0), (0.0, 0.0, -1.0), (0.0, -0.6, 0.8)):
        safe_set = SafeSet((wall(normal, -0.45, 0.0),))
        there = at((0.1, -0.1, 0.05), rotation=tilted)._replace(q_arm=(0.5, -0.3))
        _, _, margin = filtered(law, moving_zones(safe_set, None), there, ZERO, ZERO, ZERO)
        exact = margins.report(safe_set, there, None).margins
        seen = [m for m, part in zip(exact, parts.parts, strict=True) if part.end is None]
        assert margin == pytest.approx(min(seen), abs=2e-3)


def test_a_zone_that_moves_is_where_it_is_now_and_its_speed_counts() -> None:
    zone = Zone(ball((2.0, 0.0, -1.0), 0.3), 0.1, velocity=(-1.0, 0.0, 0.0), t_us=1_000_000)
    zones = moving_zones(SafeSet((zone,)), None)
    there = at((0.3, 0.0, -1.0), t_us=2_000_000)
    result, changed, margin = filtered(law=LAW, zones=zones, estimate=there, v=ZERO, a=ZERO,
                                       wanted=ZERO)  # fmt: skip
    assert margin == pytest.approx(0.3)
    assert changed
    assert result[0] < -0.5, "it yields"
    earlier = there._replace(t_us=1_000_000)
    assert filtered(LAW, zones, earlier, ZERO, ZERO, ZERO) == (ZERO, False, math.inf)


def test_the_sphere_rides_on_the_target_and_holds_the_base_alone() -> None:
    target = EndEffectorTarget(1_000_000, (1.0, 0.0, -1.0), (0.5, 0.0, 0.0), ZERO)
    safe_set = SafeSet((target_sphere((0.0, 0.0, -0.2), 0.1), AHEAD))
    assert len(moving_zones(safe_set, None)) == 1, "without a target there is no sphere"
    zones = moving_zones(SafeSet(safe_set.zones[:1]), target)
    centre = at((1.05, 0.0, -1.2), t_us=1_100_000)
    _, changed, margin = filtered(LAW, zones, centre, (0.5, 0.0, 0.0), ZERO, ZERO)
    assert (changed, margin) == (False, pytest.approx(0.1))
    behind = centre._replace(p_WB=(0.98, 0.0, -1.2))
    result, changed, margin = filtered(LAW, zones, behind, ZERO, ZERO, ZERO)
    assert changed
    assert margin == pytest.approx(0.03)
    assert result[0] > 0.5


def test_less_is_asked_for_with_a_negative_allowance() -> None:
    lenient = law_of(tuning=replace(STRICT, allowance=-1.0))
    args = ((AHEAD,), (0.85, 0.0, -1.0), (0.2, 0.0, 0.0), (0.5, 0.0, 0.0))
    strict, _, _ = asked(*args)
    less, _, _ = asked(*args, law=lenient)
    assert less[0] == pytest.approx(strict[0] + 1.0)


def test_it_never_asks_for_more_than_the_loops_stand() -> None:
    result, changed, _ = asked((AHEAD,), (0.99, 0.0, -1.0), (3.0, 0.0, 0.0), ZERO)
    assert changed
    assert result == (-2.5, 0.0, 0.0)
    floor = wall((0.0, 0.0, -1.0), 0.0, 0.1)
    result, _, _ = asked((floor,), (0.0, 0.0, -0.05), (0.0, 0.0, 3.0), ZERO)
    assert result == (0.0, 0.0, -3.0)
    assert np.isfinite(result).all()
