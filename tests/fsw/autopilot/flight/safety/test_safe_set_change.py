"""Whether a change of the safe set is a shrink: what is said to be one must be one."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fsw.autopilot.flight.safety.safe_set_change import growth, is_update, summary
from fsw.autopilot.shapes.ball import ball, point
from fsw.autopilot.shapes.box import box
from fsw.autopilot.shapes.cylinder import cylinder
from fsw.autopilot.shapes.half_space import half_space, wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.vertical_cylinder import column, vertical_cylinder
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import EndEffectorTarget, SafeSet, Shape, Touch, Vec3, Zone

ZERO = (0.0, 0.0, 0.0)
TARGET = EndEffectorTarget(0, (0.2, -0.1, -1.0), ZERO, ZERO)
ROUNDING = 1e-9  # m

_LENGTHS = st.sampled_from([0.0, 0.1, 0.3, 0.5, 1.0, 2.0]) | st.floats(-2.0, 2.0)
_SIZES = st.sampled_from([0.05, 0.1, 0.5, 1.0]) | st.floats(0.01, 2.0)
_PLACES = st.tuples(_LENGTHS, _LENGTHS, _LENGTHS)
_NORMALS = st.sampled_from(
    [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.8, 0.0), (0.6, 0.0, -0.8)]
)
_ATTITUDES = st.sampled_from([(1.0, 0.0, 0.0, 0.0), (0.6, 0.0, 0.8, 0.0), (0.5, 0.5, -0.5, 0.5)])


@st.composite
def _pipes(draw: st.DrawFn) -> Shape:
    (x, y, z), (dx, dy, dz) = draw(_PLACES), draw(_NORMALS)
    length = draw(_SIZES)
    end = (x + length * dx, y + length * dy, z + length * dz)
    return cylinder((x, y, z), end, draw(_SIZES))


@st.composite
def _columns(draw: st.DrawFn) -> Shape:
    x, y, top = draw(_PLACES)
    return vertical_cylinder((x, y), draw(_SIZES), top, top + draw(_SIZES))


_SHAPES = st.one_of(
    st.builds(half_space, _NORMALS, _LENGTHS),
    st.builds(ball, _PLACES, _SIZES),
    st.builds(box, _PLACES, st.tuples(_SIZES, _SIZES, _SIZES), _ATTITUDES),
    _pipes(),
    _columns(),
    st.builds(lambda p: vertical_cylinder(p[:2], 0.1), _PLACES),
)
_ZONES = st.one_of(
    st.builds(Zone, _SHAPES, _SIZES, st.booleans()),
    st.builds(target_sphere, _PLACES, _SIZES),
)
_SETS = st.lists(_ZONES, max_size=3).map(lambda zones: SafeSet(tuple(zones)))
_BY = st.sampled_from([-0.3, -0.01, 0.0, 0.0, 0.0, 0.01, 0.3])


def margin(safe_set: SafeSet, p: Vec3) -> float:
    """How far a point is inside, by the distance to each zone."""
    return min((at.distance for at in surfaces(safe_set, p, 0, TARGET)), default=float("inf"))


@st.composite
def _changed(draw: st.DrawFn, zone: Zone) -> Zone:
    """A zone with its clearance, its size, or any of its numbers changed, or another."""
    what = draw(st.integers(0, 3))
    if what == 0:
        return draw(_ZONES)
    numbers = list(zone.shape.numbers)
    if what >= 2:
        at = len(numbers) - 1 if what == 2 else draw(st.integers(0, len(numbers) - 1))
        at = min(at, 5) if zone.shape.kind == "box" else at
        numbers[at] += draw(_BY)
    shape = Shape(zone.shape.kind, tuple(numbers))
    return replace(zone, shape=shape, clearance=zone.clearance + draw(_BY))


@st.composite
def changes(draw: st.DrawFn) -> tuple[SafeSet, SafeSet]:
    """A safe set, and one that was made from it: zones changed, exchanged, dropped, added."""
    old = draw(_SETS)
    kept = [draw(_changed(zone)) for zone in old.zones if draw(st.integers(0, 9))]
    return old, SafeSet((*kept, *draw(st.lists(_ZONES, max_size=1))))


BALL = point((1.0, 0.0, -1.0), 0.3)
POST = column((1.0, 0.0), 0.3)


@pytest.mark.requirement("REQ-SAFE-9")
@given(changes(), st.lists(_PLACES, min_size=1, max_size=20))
@example((SafeSet((BALL,)), SafeSet((wall((-1.0, 0.0, 0.0), -0.7, 0.0),))), [(1.0, 0.0, -1.0)])
@example((SafeSet((POST,)), SafeSet((BALL,))), [(1.0, 0.0, 5.0)])
@example((SafeSet((BALL,)), SafeSet((replace(BALL, keep_in=True),))), [(1.0, 0.0, -1.0)])
def test_after_a_shrink_a_safe_place_was_safe_before(
    change: tuple[SafeSet, SafeSet], places: list[Vec3]
) -> None:
    old, new = change
    if growth(old, new):
        return
    # Points of random sets are hardly ever just beyond a zone: those are tried as well.
    for zone in old.zones:
        for p in list(places):
            for at in surfaces(SafeSet((zone,)), p, 0, TARGET):
                step = at.distance + 0.001
                n = at.normal
                places.append((p[0] - step * n[0], p[1] - step * n[1], p[2] - step * n[2]))
    for p in places:
        if margin(new, p) >= ROUNDING:
            assert margin(old, p) >= -ROUNDING, (old, new, p)


@given(_SETS, _SETS)
def test_to_stay_and_to_be_added_to_is_a_shrink(one: SafeSet, other: SafeSet) -> None:
    assert growth(one, one) == ""
    assert growth(SafeSet(), one) == ""
    assert growth(one, SafeSet(other.zones + one.zones)) == ""
    assert growth(one, SafeSet(one.zones[::-1])) == ""


FRONT = wall((1.0, 0.0, 0.0), -5.0, 0.1)
SPHERE = target_sphere((0.0, 0.0, -0.225), 0.075)
SHELF = Zone(box((1.0, 0.0, -1.0), (0.3, 0.2, 0.1)), 0.1)
PIPE = Zone(cylinder((1.0, 0.0, -1.0), (2.0, 0.0, -1.0), 0.1), 0.1)
HALL = Zone(box((0.0, 0.0, -1.0), (3.0, 3.0, 2.0)), 0.1, keep_in=True)
PERSON = Zone(vertical_cylinder((2.0, 0.0), 0.25, -1.8, 0.0), 0.3, velocity=(0.5, 0.0, 0.0))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (FRONT, wall((1.0, 0.0, 0.0), -4.9, 0.1), ""),
        (FRONT, wall((1.0, 0.0, 0.0), -5.2, 0.31), ""),
        (FRONT, wall((1.0, 0.0, 0.0), -5.001, 0.1), "moves out by 1.0 mm"),
        (FRONT, wall((1.0, 0.0, 0.0), -5.0, 0.09), "loses 10.0 mm of clearance"),
        (FRONT, wall((0.6, 0.8, 0.0), -1.0, 0.1), "is removed, moved or turned"),
        (FRONT, BALL, "is removed"),
        (BALL, POST, ""),
        (BALL, replace(BALL, clearance=0.31), ""),
        (BALL, replace(BALL, clearance=0.299), "loses 1.0 mm of clearance"),
        (BALL, point((1.1, 0.0, -1.0), 0.41), ""),
        (BALL, point((1.1, 0.0, -1.0), 0.39), "is removed"),
        (BALL, wall((-1.0, 0.0, 0.0), -0.75, 0.051), ""),
        (BALL, wall((-1.0, 0.0, 0.0), -0.76, 0.05), "is removed"),
        (BALL, Zone(box((1.0, 0.0, -1.0), (0.2, 0.2, 0.2)), 0.11), ""),
        (POST, BALL, "is removed"),
        (POST, column((1.1, 0.0), 0.41), ""),
        (POST, column((1.1, 0.0), 0.39), "is removed"),
        (POST, Zone(vertical_cylinder((1.0, 0.0), 0.5, -3.0, 0.0), 0.3), "is removed"),
        (SHELF, Zone(box((1.0, 0.0, -1.0), (0.3, 0.25, 0.1)), 0.1), ""),
        (SHELF, Zone(box((1.0, 0.0, -1.0), (0.3, 0.19, 0.2)), 0.1), "is removed"),
        (PIPE, Zone(cylinder((1.0, 0.0, -1.0), (2.0, 0.0, -1.0), 0.2), 0.1), ""),
        (PIPE, Zone(cylinder((1.0, 0.0, -1.0), (1.9, 0.0, -1.0), 0.2), 0.1), "is removed"),
        (HALL, replace(HALL, clearance=0.2), ""),
        (HALL, Zone(box((0.0, 0.0, -1.0), (3.0, 2.9, 2.0)), 0.1, keep_in=True), ""),
        (HALL, Zone(box((0.0, 0.0, -1.0), (3.1, 3.0, 2.0)), 0.1, keep_in=True), "is removed"),
        (HALL, replace(HALL, keep_in=False), "is removed"),
        (SPHERE, target_sphere((0.0, 0.0, -0.225), 0.07), ""),
        (SPHERE, target_sphere((0.0, 0.0, -0.225), 0.08), "is removed"),
        (SPHERE, FRONT, "is removed"),
        (PERSON, PERSON, ""),
        (PERSON, replace(PERSON, clearance=0.4), ""),
        (PERSON, replace(PERSON, t_us=1), "is removed"),
        (PERSON, replace(PERSON, velocity=ZERO), "is removed"),
    ],
)
def test_what_is_a_shrink_and_why_not(old: Zone, new: Zone, why: str) -> None:
    found = growth(SafeSet((old,)), SafeSet((new,)))
    assert bool(found) == bool(why), found
    assert found.startswith(f"zone 1 ({old.shape.kind}) {why}" if why else "")


def test_the_zone_that_grows_is_named_by_its_number() -> None:
    assert growth(SafeSet((FRONT, BALL)), SafeSet((FRONT,))).startswith("zone 2 (ball)")


def test_an_update_moves_what_moves_and_nothing_else() -> None:
    moved = replace(PERSON, shape=vertical_cylinder((2.1, 0.0), 0.25, -1.8, 0.0), t_us=200_000)
    before = SafeSet((FRONT, PERSON))
    assert is_update(before, SafeSet((FRONT, moved)))
    assert not is_update(before, SafeSet((moved, FRONT)))
    assert not is_update(before, SafeSet((FRONT,)))
    assert not is_update(before, SafeSet((FRONT, replace(moved, clearance=0.2))))
    assert not is_update(before, SafeSet((FRONT, replace(moved, velocity=ZERO))))
    assert not is_update(before, SafeSet((wall((1.0, 0.0, 0.0), -4.9, 0.1), PERSON)))


def test_a_safe_set_is_summed_up_in_words() -> None:
    assert summary(SafeSet()) == "nothing to keep clear of"
    assert summary(SafeSet((FRONT, BALL, BALL))) == "1 half-space, 2 balls"
    assert summary(SafeSet((SHELF, SHELF))) == "2 boxes"


@pytest.mark.parametrize(
    ("old", "new", "grown"),
    [
        (None, Touch(5.0, 1e3, 1e4), True),
        (Touch(5.0, 1e3, 1e4), Touch(6.0, 1e3, 1e4), True),
        (Touch(5.0, 1e3, 1e4), Touch(5.0, 1e3, 9e3), True),
        (Touch(5.0, 1e3, 1e4), Touch(4.0, 1e3, 1e4), False),
        (Touch(5.0, 1e3, 1e4), None, False),
    ],
)
def test_to_touch_what_might_not_be_touched_is_growth(
    old: Touch | None, new: Touch | None, grown: bool
) -> None:
    one = wall((1.0, 0.0, 0.0), 2.0, 0.1)
    before, after = (SafeSet((replace(one, touch=touch),)) for touch in (old, new))
    said = growth(before, after)
    assert said == ("zone 1 (half-space) may be touched, or pressed harder" if grown else "")
