"""What holds of every shape: distances by Coal, normals by differences, half-spaces by support."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.model.prediction import Array
from fsw.autopilot.shapes import BY_NAME, BY_NUMBER, KINDS, kind_of
from fsw.autopilot.shapes.kind import NUMBERS
from fsw.autopilot.signals import Shape
from tests.fsw.autopilot.shapes.by_coal import distance, random_point, random_shape, reach
from tests.fsw.autopilot.shapes.planes import inside, outside
from tests.fsw.random_states import vec3

every_kind = pytest.mark.parametrize("kind", [kind.name for kind in KINDS])
seeds = st.integers(0, 2**31)
TRIES = 60
COAL = 2e-5  # m, Coal's own tolerance is 1e-6 of the Minkowski difference


def drawn(kind: str, seed: int) -> tuple[Shape, np.random.Generator]:
    random = np.random.default_rng(seed)
    return random_shape(kind, random), random


@every_kind
def test_the_distance_is_coals_in_front_of_a_shape(kind: str) -> None:
    for seed in range(TRIES):
        shape, random = drawn(kind, seed)
        p = random_point(random)
        expected, found = distance(shape, p), outside(shape, p).distance
        assert (found > 0.0) is (expected > 0.0)
        if expected > 0.0:
            assert found == pytest.approx(expected, abs=COAL)


@every_kind
def test_the_depth_is_the_shortest_way_out_of_a_shape(kind: str) -> None:
    """Over all directions by the support function; Coal's depth in a cylinder is not the least."""
    deep = 0
    for seed in range(TRIES):
        shape, random = drawn(kind, seed)
        p = 0.5 * np.array(random_point(random))
        at = outside(shape, vec3(p))
        if at.distance >= 0.0:
            continue
        deep += 1
        directions = random.standard_normal((100, 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        for n in directions:
            assert reach(shape, n) - float(n @ p) >= -at.distance - 1e-12
        n = np.array(at.normal)
        assert reach(shape, n) - float(n @ p) == pytest.approx(-at.distance, abs=1e-12)
    assert deep > 5, "or it was no test"


@every_kind
def test_the_normal_is_the_gradient_of_the_distance(kind: str) -> None:
    step = 1e-6
    for seed in range(TRIES):
        shape, random = drawn(kind, seed)
        p = np.array(random_point(random))
        ahead, behind = (
            [outside(shape, vec3(p + sign * step * axis)).distance for axis in np.eye(3)]
            for sign in (1.0, -1.0)
        )
        at = outside(shape, vec3(p))
        np.testing.assert_allclose(at.normal, np.subtract(ahead, behind) / (2.0 * step), atol=1e-5)
        for one in (at, *inside(shape, vec3(p))):
            assert math.hypot(*one.normal) == pytest.approx(1.0, abs=1e-12)


@every_kind
@given(seed=seeds)
def test_no_step_changes_a_distance_by_more_than_its_length(kind: str, seed: int) -> None:
    shape, random = drawn(kind, seed)
    p, q = random_point(random), random_point(random)
    near = vec3(np.array(p) + 1e-3 * random.standard_normal(3))
    for other in (q, near):
        change = abs(outside(shape, p).distance - outside(shape, other).distance)
        assert change <= math.dist(p, other) + 1e-12


@every_kind
@given(seed=seeds)
def test_no_place_of_a_shape_is_in_front_of_the_plane_that_keeps_a_point_out(
    kind: str, seed: int
) -> None:
    """In front of the plane is free space for certain; and from outside the plane touches."""
    shape, random = drawn(kind, seed)
    p = random_point(random)
    at = outside(shape, p)
    plane = float(np.dot(at.normal, p)) - at.distance
    farthest = reach(shape, np.array(at.normal))
    assert farthest <= plane + 1e-9
    if at.distance > 0.0:
        assert farthest == pytest.approx(plane, abs=1e-9)


@every_kind
@given(seed=seeds)
def test_a_point_is_inside_where_all_planes_that_keep_it_in_say_so(kind: str, seed: int) -> None:
    shape, random = drawn(kind, seed)
    p = random_point(random)
    least = min(one.distance for one in inside(shape, p))
    depth = -outside(shape, p).distance
    assert (least >= 0.0) is (depth >= 0.0)
    if depth >= 0.0:
        assert least == pytest.approx(depth, abs=1e-12)


@every_kind
@given(seed=seeds)
def test_every_plane_that_keeps_a_point_in_has_the_shape_in_front_of_it(
    kind: str, seed: int
) -> None:
    shape, random = drawn(kind, seed)
    p = random_point(random)
    normals = []
    for at in inside(shape, p):
        n = np.array(at.normal)
        plane = float(n @ p) - at.distance
        assert -reach(shape, -n) >= plane - 1e-9
        normals.append(n)
    if np.isfinite(reach(shape, np.array([1.0, 0.0, 0.0]))):
        assert enclosed_by(np.array(normals))


def enclosed_by(normals: Array) -> bool:
    """Whether half-spaces with these normals can have something bounded in common."""
    return np.linalg.matrix_rank(normals) == 3 and np.allclose(normals.sum(axis=0), 0.0)


@every_kind
@given(seed=seeds)
def test_a_moved_shape_is_where_it_was_moved_to(kind: str, seed: int) -> None:
    shape, random = drawn(kind, seed)
    shift, p = vec3(random.uniform(-2.0, 2.0, 3)), random_point(random)
    moved = Shape(kind, kind_of(shape).moved(shape.numbers, shift))
    there, here = outside(moved, vec3(np.add(p, shift))), outside(shape, p)
    assert there == pytest.approx(here, abs=1e-9)


def test_names_and_numbers_are_each_of_one_kind() -> None:
    assert len(BY_NAME) == len(BY_NUMBER) == len(KINDS)
    assert all(kind.size <= NUMBERS for kind in KINDS)
    assert [kind.number for kind in KINDS] == sorted(BY_NUMBER)


@every_kind
def test_what_is_drawn_here_describes_a_shape_and_other_numbers_do_not(kind: str) -> None:
    shape, _ = drawn(kind, 1)
    of = kind_of(shape)
    assert of.check(shape) is None
    short = of.check(Shape(kind, shape.numbers[1:]))
    assert short is not None
    assert f"has {of.size} numbers, not {of.size - 1}" in short
    for k in range(of.size):
        numbers = [*shape.numbers]
        numbers[k] = math.nan
        bad = of.check(Shape(kind, tuple(numbers)))
        assert bad is not None
        assert "not finite" in bad


@every_kind
def test_the_ball_around_a_shape_holds_all_of_it(kind: str) -> None:
    for seed in range(TRIES):
        shape, random = drawn(kind, seed)
        around = kind_of(shape).ball_around(shape.numbers)
        assert (around is None) == (kind_of(shape).flat or kind_of(shape).follows_target)
        if around is None:
            continue
        centre, radius = around
        for n in random.standard_normal((20, 3)):
            n /= np.linalg.norm(n)
            assert reach(shape, n) <= float(n @ np.array(centre)) + radius + 1e-9
