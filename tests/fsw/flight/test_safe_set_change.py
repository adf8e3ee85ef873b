"""Whether a change of the safe set is a shrink: what is said to be one must be one."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fsw.barriers.tangent import distance_to
from fsw.flight.safe_set_change import growth, summary
from fsw.geometry.vectors import dot, subtract
from fsw.signals import PointObstacle, SafeSet, Vec3, Wall, WorkspaceSphere

TARGET: Vec3 = (0.2, -0.1, -1.0)
ROUNDING = 1e-9  # m

_LENGTHS = st.sampled_from([0.0, 0.1, 0.3, 0.5, 1.0, 2.0]) | st.floats(-2.0, 2.0)
_SIZES = st.sampled_from([0.05, 0.1, 0.5, 1.0]) | st.floats(0.01, 2.0)
_PLACES = st.tuples(_LENGTHS, _LENGTHS, _LENGTHS)
_NORMALS = st.sampled_from(
    [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.8, 0.0), (0.6, 0.0, -0.8)]
)
_WALLS = st.builds(Wall, _NORMALS, _LENGTHS, _SIZES)
_OBSTACLES = st.builds(PointObstacle, _PLACES, _SIZES, st.booleans())
_SPHERES = st.none() | st.builds(WorkspaceSphere, _PLACES, _SIZES)
_SETS = st.builds(
    SafeSet,
    st.lists(_WALLS, max_size=2).map(tuple),
    _SPHERES,
    st.lists(_OBSTACLES, max_size=2).map(tuple),
)


def margin(safe_set: SafeSet, p: Vec3) -> float:
    """How far a point is inside, by the definition of each shape."""
    margins = [dot(w.normal, p) - w.offset - w.clearance for w in safe_set.walls]
    margins += [distance_to(one, p) - one.clearance for one in safe_set.obstacles]
    if safe_set.sphere is not None:
        away = subtract(subtract(p, TARGET), safe_set.sphere.centre_from_target)
        margins.append(safe_set.sphere.radius - math.hypot(*away))
    return min(margins, default=math.inf)


@st.composite
def changes(draw: st.DrawFn) -> tuple[SafeSet, SafeSet]:
    """A safe set, and another or one that was made from it: moved, resized, added to, cut."""
    old = draw(_SETS)
    if draw(st.booleans()):
        return old, draw(_SETS)
    by = st.sampled_from([-0.3, -0.01, 0.0, 0.0, 0.01, 0.3])
    shift = st.tuples(by, by, by)

    def moved(p: Vec3) -> Vec3:
        dx, dy, dz = draw(shift)
        return p[0] + dx, p[1] + dy, p[2] + dz

    walls = [
        replace(w, offset=w.offset + draw(by), clearance=w.clearance + draw(by)) for w in old.walls
    ]
    obstacles = [
        replace(one, position=moved(one.position), clearance=one.clearance + draw(by),
                upright=draw(st.sampled_from([one.upright, True])))
        for one in old.obstacles
    ]  # fmt: skip
    sphere = old.sphere and WorkspaceSphere(
        moved(old.sphere.centre_from_target), old.sphere.radius + draw(by)
    )
    return old, SafeSet(
        tuple(walls + draw(st.lists(_WALLS, max_size=1))),
        sphere,
        tuple(obstacles + draw(st.lists(_OBSTACLES, max_size=1))),
    )


BALL = PointObstacle((1.0, 0.0, -1.0), 0.3)
POST = replace(BALL, upright=True)
BEFORE_BALL = Wall((-1.0, 0.0, 0.0), -0.7, 0.0)


@given(changes(), st.lists(_PLACES, min_size=1, max_size=20))
@example(
    (SafeSet(obstacles=(BALL,)), SafeSet((Wall((-1.0, 0.0, 0.0), -0.7, 0.0),))), [BALL.position]
)
@example(
    (SafeSet(obstacles=(replace(BALL, upright=True),)), SafeSet(obstacles=(BALL,))),
    [(1.0, 0.0, 5.0)],
)
def test_after_a_shrink_a_safe_place_was_safe_before(
    change: tuple[SafeSet, SafeSet], places: list[Vec3]
) -> None:
    old, new = change
    if growth(old, new):
        return
    # Points of random sets are hardly ever just outside a shape: those are tried as well.
    for shape in old.obstacles:
        for n in ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (-0.6, 0.8, 0.0)):
            reach = 0.999 * shape.clearance
            p, (x, y, z) = shape.position, n
            places = [*places, (p[0] + reach * x, p[1] + reach * y, p[2] + reach * z)]
    for wall in old.walls:
        depth = wall.offset + wall.clearance - 0.001
        for side in ((0.0, 0.0, 0.0), (0.3, -0.4, 0.5)):
            d = depth - dot(wall.normal, side)
            x, y, z = wall.normal
            places = [*places, (side[0] + d * x, side[1] + d * y, side[2] + d * z)]
    for p in places:
        if margin(new, p) >= ROUNDING:
            assert margin(old, p) >= -ROUNDING, (old, new, p)


@given(_SETS, _SETS)
def test_to_stay_and_to_be_added_to_is_a_shrink(one: SafeSet, other: SafeSet) -> None:
    assert growth(one, one) == ""
    assert growth(SafeSet(), one) == ""
    more = SafeSet(one.walls + other.walls, one.sphere, one.obstacles + other.obstacles)
    assert growth(one, more) == ""
    reordered = SafeSet(one.walls[::-1], one.sphere, one.obstacles[::-1])
    assert growth(one, reordered) == ""


WALL = Wall((1.0, 0.0, 0.0), -5.0, 0.1)
SPHERE = WorkspaceSphere((0.0, 0.0, -0.225), 0.075)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (SafeSet((WALL,)), SafeSet((replace(WALL, offset=-4.9),)), ""),
        (SafeSet((WALL,)), SafeSet((replace(WALL, clearance=0.2),)), ""),
        (SafeSet((WALL,)), SafeSet((Wall(WALL.normal, -5.2, 0.3),)), ""),
        (SafeSet((WALL,)), SafeSet((replace(WALL, offset=-5.001),)), "wall 0 moves out by 1.0 mm"),
        (SafeSet((WALL,)), SafeSet((replace(WALL, normal=(0.6, 0.8, 0.0)),)), "wall 0 is removed"),
        (SafeSet(obstacles=(BALL,)), SafeSet(obstacles=(replace(BALL, upright=True),)), ""),
        (SafeSet(obstacles=(BALL,)), SafeSet(obstacles=(replace(BALL, clearance=0.299),)),
         "obstacle 0 shrinks by 1.0 mm"),
        (SafeSet(obstacles=(replace(BALL, upright=True),)), SafeSet(obstacles=(BALL,)),
         "obstacle 0 is removed or moved"),
        (SafeSet(obstacles=(BALL,)), SafeSet(obstacles=(PointObstacle((1.1, 0.0, -1.0), 0.41),)),
         ""),
        (SafeSet(obstacles=(BALL,)), SafeSet(obstacles=(PointObstacle((1.1, 0.0, -1.0), 0.39),)),
         "obstacle 0 is removed or moved"),
        (SafeSet(obstacles=(BALL,)), SafeSet((Wall((-1.0, 0.0, 0.0), -0.75, 0.05),)), ""),
        (SafeSet(obstacles=(BALL,)), SafeSet((Wall((-1.0, 0.0, 0.0), -0.76, 0.05),)), "obstacle 0"),
        (SafeSet(sphere=SPHERE), SafeSet(sphere=replace(SPHERE, radius=0.07)), ""),
        (SafeSet(sphere=SPHERE), SafeSet(sphere=replace(SPHERE, radius=0.08)),
         "the workspace sphere grows"),
        (SafeSet(sphere=SPHERE), SafeSet((WALL,)), "the workspace sphere is removed"),
    ],
)  # fmt: skip
def test_what_is_a_shrink_and_why_not(old: SafeSet, new: SafeSet, why: str) -> None:
    found = growth(old, new)
    assert found.startswith(why)
    assert bool(found) == bool(why)


def test_a_safe_set_is_summed_up_in_words() -> None:
    assert summary(SafeSet()) == "nothing to keep clear of"
    assert summary(SafeSet((WALL,), obstacles=(BALL, BALL))) == "1 wall, 2 obstacles"
    assert summary(SafeSet(sphere=SPHERE)) == "a workspace sphere of 75 mm"
