"""The filter of the acceleration: when it changes nothing, and that it keeps off what it sees."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.autopilot.barriers.safe_approach import BarrierTuning
from fsw.autopilot.control.safety_filter import (
    ROOM,
    FilterLaw,
    FilterTuning,
    filter_law,
    filter_probes,
    filtered,
)
from fsw.autopilot.geometry.vectors import dot
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.parts import Part
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.shapes import KINDS
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.box import box
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.zones import NO_ZONES, moving_zones
from fsw.autopilot.signals import EndEffectorTarget, SafeSet, Shape, StateEstimate, Vec3, Zone
from sitl.distance import along_segment, farthest_of_rotor, of_rotor
from sitl.nearest import nearest
from sitl.shapes import KINDS as REFEREE_KINDS
from tests.fsw.autopilot.shapes import by_coal
from tests.fsw.random_states import estimate_of, random_estimate, vec3
from tests.fsw.vehicle_places import placed

in_long = partial(pytest.param, marks=pytest.mark.long)

ZERO: Vec3 = (0.0, 0.0, 0.0)
LAG, REACH = 0.11, 0.3
TUNING = BarrierTuning()
STRICT = FilterTuning(allowance=0.0)
AHEAD = wall((-1.0, 0.0, 0.0), -1.0, 0.1)  # the vehicle must stay at x < 0.9


def law_of(tuning: FilterTuning = STRICT, lag: float = LAG) -> FilterLaw:
    return filter_law(tuning, (TUNING, TUNING), REACH, lag, 2.5)


LAW = law_of()
BODIES = AIRFRAME.bodies
POINTS = filter_probes(body_of("points", AIRFRAME))


def at(p: Vec3, t_us: int = 0, rotation: Rotation | None = None) -> StateEstimate:
    return estimate_of(rotation or Rotation.identity(), p_WB=p)._replace(
        t_us=t_us, q_arm=(0.0, 0.0), w_WB_B=ZERO
    )


def asked(
    zones: tuple[Zone, ...], p: Vec3, v: Vec3, wanted: Vec3, a: Vec3 = ZERO, law: FilterLaw = LAW
) -> tuple[Vec3, bool, float]:
    return filtered(
        law, AIRFRAME.bodies, POINTS, moving_zones(SafeSet(zones), None), at(p), v, a, wanted
    )


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
    assert filtered(LAW, BODIES, POINTS, NO_ZONES, at(ZERO), ZERO, ZERO, wanted) == (
        wanted,
        False,
        math.inf,
    )
    assert asked((AHEAD,), (0.2, 0.0, -1.0), ZERO, wanted) == (wanted, False, math.inf)
    assert moving_zones(SafeSet(), None) is NO_ZONES


@pytest.mark.requirement("REQ-SAFE-5")
def test_what_keeps_the_condition_passes_bit_for_bit() -> None:
    wanted = (-0.1234567891234, 0.3, 1.0)
    result, changed, margin = asked((AHEAD,), (0.6, 0.0, -1.0), (0.1, 0.4, 0.0), wanted)
    assert (result, changed) == (wanted, False)
    assert margin == pytest.approx(0.3)


@pytest.mark.requirement("REQ-SAFE-5")
@given(st.floats(0.5, 1.0), st.floats(-0.5, 1.0), st.floats(-2.5, 2.5), st.floats(-2.0, 2.0))
@example(0.9, 0.0, 0.0, 0.0)  # just kept
def test_towards_a_wall_it_is_the_nearest_that_keeps_the_condition(
    x: float, vx: float, ax: float, along: float
) -> None:
    wanted = (ax, 0.7, -0.4)
    result, changed, margin = asked((AHEAD,), (x, 0.0, -1.0), (vx, 0.2, 0.1), wanted, (along, 0, 0))
    assert margin == pytest.approx(0.9 - x)
    needed = least_needed(0.9 - x, -vx, -along)
    assert changed == (-ax < needed) or -ax == pytest.approx(needed, abs=1e-9)
    assert result[1:] == wanted[1:], "along the normal only"
    assert -result[0] == pytest.approx(min(max(-ax, needed), 2.5) if changed else -ax)


@pytest.mark.requirement("REQ-SAFE-5")
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


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-SAFE-5")
@pytest.mark.parametrize(
    ("speed", "eager"),
    [
        *((0.0, 0.0), (0.0, 2.5), (0.5, 1.0), (0.9, 0.0), (0.9, 2.5)),
        *(in_long(0.0, 1.0), in_long(0.5, 0.0), in_long(0.5, 2.5), in_long(0.9, 1.0)),
        *(in_long(0.2, eager) for eager in (0.0, 1.0, 2.5)),
    ],
)
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


@pytest.mark.drawn(2)
@pytest.mark.parametrize("keep_in", [False, True])
@pytest.mark.parametrize("kind", [kind.name for kind in KINDS if not kind.follows_target])
def test_the_margin_is_what_the_referee_sees_of_every_part(kind: str, keep_in: bool) -> None:
    """The referee searches by golden sections with distances of its own; as near as it acts."""
    random, law, compared = np.random.default_rng(5), law_of(replace(STRICT, near=100.0)), 0
    full = body_of("full", AIRFRAME)
    for _ in range(100):
        there = random_estimate(random)._replace(p_WB=vec3(random.uniform(-1.2, 1.2, 3)))
        shape, on = by_coal.random_shape(kind, random, 4.0 if keep_in else 1.0), placed(there)
        zones = moving_zones(SafeSet((Zone(shape, 0.05, keep_in=keep_in),)), None)
        seen = min(by_referee(shape, keep_in, part, *on[part.on]) for part in full.parts) - 0.05
        if 0.0 < seen < 0.6:
            compared += 1
            _, _, margin = filtered(
                law, AIRFRAME.bodies, filter_probes(full), zones, there, ZERO, ZERO, ZERO
            )
            assert margin == pytest.approx(seen, abs=5e-4)
    assert compared > 10


def by_referee(shape: Shape, keep_in: bool, part: Part, origin: Array, turned: Rotation) -> float:
    number = next(kind.number for kind in KINDS if kind.name == shape.kind)
    which = next(k for k, kind in enumerate(REFEREE_KINDS) if kind.number == number)
    numbers = np.array((*shape.numbers, *(0.0,) * (16 - len(shape.numbers))))
    begin = vec3(origin + turned.apply(part.begin))
    end = vec3(origin + turned.apply(part.end or part.begin))
    if part.rim > 0.0:
        axis = vec3(turned.as_matrix()[:, 2])
        if keep_in:
            return -farthest_of_rotor(which, numbers, begin, axis, part.rim, 0.0) - part.radius
        return of_rotor(which, numbers, begin, axis, part.rim, 0.0) - part.radius
    if keep_in:
        deep = [nearest(which, numbers, place).distance for place in (begin, end)]
        return -max(deep) - part.radius
    return along_segment(which, numbers, begin, end) - part.radius


def test_every_wall_of_a_room_keeps_the_vehicle_in() -> None:
    room = moving_zones(SafeSet((Zone(box(ZERO, (1.0, 1.2, 1.5)), 0.0, keep_in=True),)), None)
    for axis, half in enumerate((1.0, 1.2, 1.5)):
        for sign in (1.0, -1.0):
            p = [0.0, 0.0, 0.0]
            p[axis] = sign * (half - 0.05)
            parts = POINTS._replace(rows=POINTS.rows[:1])  # the base alone
            result, changed, margin = filtered(
                LAW,
                AIRFRAME.bodies,
                parts,
                room,
                at(vec3(p)),
                vec3(np.multiply(4.0, p)),
                ZERO,
                ZERO,
            )
            assert changed
            assert margin == pytest.approx(0.05)
            assert sign * result[axis] < -0.5


def test_a_zone_that_moves_is_where_it_is_now_and_its_speed_counts() -> None:
    zone = Zone(ball((2.0, 0.0, -1.0), 0.3), 0.1, velocity=(-1.0, 0.0, 0.0), t_us=1_000_000)
    zones = moving_zones(SafeSet((zone,)), None)
    there = at((0.3, 0.0, -1.0), t_us=2_000_000)
    result, changed, margin = filtered(LAW, BODIES, POINTS, zones, there, ZERO, ZERO, ZERO)
    assert margin == pytest.approx(0.3)
    assert changed
    assert result[0] < -0.5, "it yields"
    earlier = there._replace(t_us=1_000_000)
    assert filtered(LAW, BODIES, POINTS, zones, earlier, ZERO, ZERO, ZERO) == (
        ZERO,
        False,
        math.inf,
    )


def test_the_sphere_rides_on_the_target_and_holds_the_base_alone() -> None:
    target = EndEffectorTarget(1_000_000, (1.0, 0.0, -1.0), (0.5, 0.0, 0.0), ZERO)
    safe_set = SafeSet((target_sphere((0.0, 0.0, -0.2), 0.1), AHEAD))
    assert len(moving_zones(safe_set, None)) == 1, "without a target there is no sphere"
    zones = moving_zones(SafeSet(safe_set.zones[:1]), target)
    centre = at((1.05, 0.0, -1.2), t_us=1_100_000)
    _, changed, margin = filtered(
        LAW, AIRFRAME.bodies, POINTS, zones, centre, (0.5, 0.0, 0.0), ZERO, ZERO
    )
    assert (changed, margin) == (False, pytest.approx(0.1))
    behind = centre._replace(p_WB=(0.98, 0.0, -1.2))
    result, changed, margin = filtered(
        LAW, AIRFRAME.bodies, POINTS, zones, behind, ZERO, ZERO, ZERO
    )
    assert changed
    assert margin == pytest.approx(0.03)
    assert result[0] > 0.5


def test_who_turns_with_the_target_is_left_alone_and_who_does_not_is_turned() -> None:
    turning = (0.0, 2.6, 0.0)
    target = EndEffectorTarget(1_000_000, (1.0, 0.0, -1.0), (0.5, 0.0, 0.0), turning)
    zones = moving_zones(SafeSet((target_sphere((0.0, 0.0, -0.2), 0.1),)), target)
    # 0.1 s later, as far beside the centre as the law lets a vehicle be that moves like the sphere.
    here = at((1.05, 0.013 - 0.05, -1.2), t_us=1_100_000)
    same = (0.5, 0.26, 0.0)
    result, changed, margin = filtered(
        LAW, AIRFRAME.bodies, POINTS, zones, here, same, turning, turning
    )
    assert (result, changed) == (turning, False)
    assert margin == pytest.approx(0.05)
    result, changed, _ = filtered(LAW, BODIES, POINTS, zones, here, same, turning, ZERO)
    assert changed
    assert result[1] > 1.0, "it would be left behind"


def test_less_is_asked_for_with_a_negative_allowance() -> None:
    lenient = law_of(replace(STRICT, allowance=-1.0))
    args = ((AHEAD,), (0.85, 0.0, -1.0), (0.2, 0.0, 0.0), (0.5, 0.0, 0.0))
    strict, _, _ = asked(*args)
    less, _, _ = asked(*args, law=lenient)
    assert less[0] == pytest.approx(strict[0] + 1.0)


def test_zones_are_looked_at_as_far_as_the_vehicle_reaches_and_a_little_more() -> None:
    """A large vehicle's rotors are at a wall while its base is far from it."""
    for reach, looks in ((0.3, False), (1.0, True)):
        law = filter_law(STRICT, (TUNING, TUNING), reach, LAG, 2.5)
        _, _, margin = asked((AHEAD,), (-0.3, 0.0, -1.0), ZERO, ZERO, law=law)
        assert math.isfinite(margin) is looks


def test_it_never_asks_for_more_than_the_loops_stand() -> None:
    result, changed, _ = asked((AHEAD,), (0.99, 0.0, -1.0), (3.0, 0.0, 0.0), ZERO)
    assert changed
    assert result == (-2.5, 0.0, 0.0)
    floor = wall((0.0, 0.0, -1.0), 0.0, 0.1)
    result, _, _ = asked((floor,), (0.0, 0.0, -0.05), (0.0, 0.0, 3.0), ZERO)
    assert result == (0.0, 0.0, -3.0)
    assert np.isfinite(result).all()


def test_what_clearances_have_grown_by_is_kept_and_is_no_margin() -> None:
    grown = Zone(AHEAD.shape, AHEAD.clearance + 0.05)
    place = (0.8, 0.0, 0.0)
    here, v, wanted = at(place), (0.2, 0.0, 0.0), (1.0, 0.0, 0.0)
    zones = moving_zones(SafeSet((grown,)), None, (0.05,))
    found, changed, margin = filtered(LAW, BODIES, POINTS, zones, here, v, ZERO, wanted)
    same, _, nearer = asked((grown,), place, v, wanted)
    assert changed
    assert found == same, "it keeps off by all of it"
    _, _, announced = asked((AHEAD,), place, v, wanted)
    assert margin == pytest.approx(announced), "and reports the margin of the safe set"
    assert nearer == pytest.approx(announced - 0.05)


@pytest.mark.requirement("REQ-SAFE-5")
def test_nothing_is_pushed_faster_than_the_speed_of_setpoints() -> None:
    law = filter_law(STRICT, (TUNING, TUNING), REACH, LAG, 2.5, 1.5)
    outside = (1.6, 0.0, -1.0)  # by 0.7 m: the barrier asks for 2.8 m/s back
    for speed, pushed in ((0.0, True), (1.0, True), (1.5, False), (3.0, False)):
        result, changed, _ = asked((AHEAD,), outside, (-speed, 0.0, 0.0), ZERO, law=law)
        assert changed is pushed
        assert bool(result[0] < 0.0) is pushed
        across, _, _ = asked((AHEAD,), outside, (-speed, 1.2, 0.0), ZERO, law=law)
        assert bool(across[0] < 0.0) is (math.hypot(speed, 1.2) < 1.5), "by several at once neither"
        _, unbounded, _ = asked((AHEAD,), outside, (-min(speed, 1.0), 0.0, 0.0), ZERO)
        assert unbounded
    unchanged = asked((AHEAD,), (0.85, 0.0, -1.0), (0.2, 0.0, 0.0), (0.5, 0.0, 0.0))
    same = asked((AHEAD,), (0.85, 0.0, -1.0), (0.2, 0.0, 0.0), (0.5, 0.0, 0.0), law=law)
    assert same == unchanged


@pytest.mark.requirement("REQ-SAFE-5")
def test_a_zone_deeper_than_its_room_pushes_nobody_and_is_reported() -> None:
    result, changed, margin = asked((AHEAD,), (0.9 + ROOM + 0.01, 0.0, -1.0), ZERO, ZERO)
    assert (result, changed) == (ZERO, False)
    assert margin == pytest.approx(-ROOM - 0.01)
    _, changed, _ = asked((AHEAD,), (0.9 + ROOM - 0.01, 0.0, -1.0), ZERO, ZERO)
    assert changed
