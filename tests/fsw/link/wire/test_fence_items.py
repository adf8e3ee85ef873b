"""Which safe set an uploaded fence is, and what is no safe set."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.path import Path

from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.vertical_cylinder import column
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import SafeSet, Vec3, Zone
from fsw.link.wire.fence_items import (
    CIRCLE_EXCLUSION,
    CIRCLE_INCLUSION,
    POLYGON_EXCLUSION,
    POLYGON_INCLUSION,
    RETURN_POINT,
    cylinders_over,
    read_fence,
)
from fsw.link.wire.mission_items import BadItem, MissionItem
from tests.fsw.zones import walls_of

Corners = list[tuple[float, float]]
CASE_1: Corners = [(1.0, 1.0), (1.0, -1.0), (-9.0, -1.0), (-9.0, 1.0)]


def locate(latitude: float, longitude: float, altitude: float) -> Vec3:
    return latitude * 111_000.0, longitude * 111_000.0, -altitude


def polygon(corners: Corners, command: int = POLYGON_INCLUSION) -> tuple[MissionItem, ...]:
    return tuple(
        MissionItem(
            command,
            1,
            (float(len(corners)), 0.0, 0.0, 0.0),
            round(1e4 * north),
            round(1e4 * east),
            0.0,
        )
        for north, east in corners
    )


def circle(radius: float, frame: int = 1, z: float = 0.0) -> MissionItem:
    return MissionItem(CIRCLE_INCLUSION, frame, (radius, 0.0, 0.0, 0.0), 10_000, 0, z)


def excluded(radius: float, north: float = 3.0) -> MissionItem:
    params = (radius, 0.0, 0.0, 0.0)
    return MissionItem(CIRCLE_EXCLUSION, 1, params, round(1e4 * north), 0, 0.0)


def safe(items: tuple[MissionItem, ...]) -> SafeSet:
    return read_fence(items, locate, 0.1)


def reason(items: tuple[MissionItem, ...]) -> BadItem:
    with pytest.raises(BadItem) as refused:
        read_fence(items, locate, 0.1)
    return refused.value


def room(safe_set: SafeSet, north: float, east: float) -> float:
    """Distance to the nearest wall, negative outside [m]."""
    walls = [wall.shape.numbers for wall in walls_of(safe_set)]
    return min(n * north + e * east - offset for n, e, _, offset in walls)


def left_to(cylinder: Zone, north: float, east: float, down: float) -> float:
    """From the surface of an upright cylinder without end, its clearance taken off [m]."""
    (at,) = surfaces(SafeSet((cylinder,)), (north, east, down), 0)
    return at.distance


def test_a_rectangle_holds_the_walls_of_case_1() -> None:
    for corners in (CASE_1, CASE_1[::-1]):
        walls = safe(polygon(corners)).zones
        numbers = [wall.shape.numbers for wall in walls]
        found = {(round(n), round(e), round(offset, 9)) for n, e, _, offset in numbers}
        assert found == {(-1, 0, -1.0), (0, 1, -1.0), (0, -1, -1.0), (1, 0, -9.0)}
        assert all(wall.clearance == 0.1 and wall.shape.numbers[2] == 0.0 for wall in walls)


def test_places_on_earth_are_walls_too() -> None:
    degrees = [(north / 111_000.0, east / 111_000.0) for north, east in CASE_1]
    items = tuple(
        MissionItem(
            POLYGON_INCLUSION, 3, (4.0, 0.0, 0.0, 0.0), round(1e7 * lat), round(1e7 * lon), 0.0
        )
        for lat, lon in degrees
    )
    assert room(safe(items), 0.0, 0.0) == pytest.approx(1.0, abs=0.02)


@given(
    st.lists(st.floats(0.0, 2.0 * math.pi), min_size=3, max_size=12, unique=True),
    st.floats(0.5, 50.0),
    st.booleans(),
)
def test_the_inside_of_a_convex_polygon_is_free(
    angles: list[float], radius: float, backwards: bool
) -> None:
    corners = [(radius * math.cos(a), radius * math.sin(a)) for a in sorted(angles)]
    vertices = polygon(corners[::-1] if backwards else corners)
    try:
        read = safe(vertices)
    except BadItem:
        assert any(word in reason(vertices).reason for word in ("shorter", "inside"))
        return
    north = sum(corner[0] for corner in corners) / len(corners)
    east = sum(corner[1] for corner in corners) / len(corners)
    assert room(read, north, east) > 0.0
    for corner in corners:
        assert room(read, *corner) == pytest.approx(0.0, abs=2e-3)
        assert room(read, *(2.0 * c - m for c, m in zip(corner, (north, east), strict=True))) < 0.0


def test_a_circle_is_an_octagon_inside_it() -> None:
    walls = safe((circle(2.0),))
    assert len(walls.zones) == 8
    for k in range(100):
        direction = 2.0 * math.pi * k / 100
        n, e = math.cos(direction), math.sin(direction)
        assert room(walls, 1.0 + 1.8 * n, 1.8 * e) > 0.0
        assert room(walls, 1.0 + 2.001 * n, 2.001 * e) < 0.0


def test_a_circle_that_travels_with_the_vehicle_is_the_workspace_sphere() -> None:
    item = MissionItem(CIRCLE_INCLUSION, 7, (0.075, 0.0, 0.0, 0.0), 0, 0, -0.225)
    assert safe((item,)) == SafeSet((target_sphere((0.0, 0.0, -0.225), 0.075),))


def test_two_polygons_are_kept_both() -> None:
    shifted = [(north + 0.5, east) for north, east in CASE_1]
    assert room(safe(polygon(CASE_1) + polygon(shifted)), -8.7, 0.0) < 0.0


@pytest.mark.parametrize(
    ("items", "result", "word"),
    [
        (polygon([(0, 0), (4, 0), (1, 1), (0, 4)]), 5, "convex"),
        (polygon([(0, 0), (4, 4), (4, 0), (0, 4)]), 5, ""),
        (polygon([(0, 0), (1, 0), (2, 0)]), 5, "inside"),
        (polygon([(0, 0), (0.01, 0), (1, 1)]), 5, "edge"),
        (polygon(CASE_1)[:3], 5, "vertices"),
        (polygon(CASE_1)[:3] + polygon([(0, 0), (1, 0), (0, 1)]), 5, "number"),
        (polygon(CASE_1[:2]), 6, "vertices"),
        (polygon(CASE_1[:2], POLYGON_EXCLUSION), 6, "vertices"),
        (polygon(CASE_1)[:3] + polygon(CASE_1, POLYGON_EXCLUSION)[:1], 5, "number"),
        ((excluded(math.inf),), 6, "radius"),
        ((excluded(1.0),) * 17, 5, "cylinders"),
        (polygon(CASE_1[:1], 16), 3, "NAV_WAYPOINT"),
        ((circle(0.0),), 6, "radius"),
        ((circle(math.nan),), 6, "radius"),
        ((circle(1.0, frame=8),), 2, "frame"),
        ((circle(0.1, 7), circle(0.1, 7)), 5, "2 workspace spheres; 1 "),
        ((circle(0.1, 7, math.nan),), 12, "centre"),
        (polygon(CASE_1) * 5, 5, "walls"),
    ],
)
def test_what_is_no_safe_set_is_refused_with_the_reason(
    items: tuple[MissionItem, ...], result: int, word: str
) -> None:
    refused = reason(items)
    assert refused.result == result
    assert word in refused.reason


def test_no_fence_is_no_safe_set() -> None:
    assert safe(()) == SafeSet()


def test_a_circle_of_exclusion_is_an_upright_cylinder() -> None:
    (cylinder,) = safe((excluded(0.5),)).zones
    assert cylinder == column((3.0, 0.0), 0.6)
    for height in (0.0, -1.4, -50.0):
        assert left_to(cylinder, 3.0, 1.0, height) == pytest.approx(0.4)


def test_a_return_point_changes_nothing_and_is_no_reason_to_refuse_the_rest() -> None:
    """QGroundControl offers one with every fence."""
    point = polygon(CASE_1[:1], RETURN_POINT)
    assert safe((*polygon(CASE_1), *point)) == safe(polygon(CASE_1))
    assert safe(point) == SafeSet()


def test_inclusion_and_exclusion_are_kept_together() -> None:
    fence = safe((excluded(0.2), *polygon(CASE_1)))
    kinds = [zone.shape.kind for zone in fence.zones]
    assert kinds == ["half-space"] * 4 + ["vertical cylinder"]


def test_a_workspace_sphere_is_kept_beside_walls_and_cylinders() -> None:
    sphere = circle(0.1, 7, -0.2)
    fence = safe((sphere, excluded(1.0), *polygon(CASE_1)))
    others = safe((excluded(1.0), *polygon(CASE_1)))
    assert fence == SafeSet((*others.zones, *safe((sphere,)).zones))


@given(
    st.lists(st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0)), min_size=3, max_size=12),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
@example([(0.0, 6.0), (2.0, -1.0), (-6.0, 0.0), (2.0, -1.0)], 0.0, 0.0)
def test_the_cylinders_cover_every_point_of_a_polygon(
    corners: Corners, share: float, other: float
) -> None:
    """Of any shape, crossing itself too: what is inside, and between two places of its outline."""
    cylinders = cylinders_over(corners, 0.1)
    path = Path(np.array([*corners, corners[0]]))
    for a in corners:
        for b, c in zip(corners, corners[1:] + corners[:1], strict=True):
            edge = (b[0] + other * (c[0] - b[0]), b[1] + other * (c[1] - b[1]))
            p = (a[0] + share * (edge[0] - a[0]), a[1] + share * (edge[1] - a[1]))
            if p in (a, edge) or path.contains_point(p):
                inside = min(left_to(o, *p, -1.0) for o in cylinders)
                assert inside <= -0.1 + 1e-6


def test_a_long_polygon_is_covered_by_several_cylinders_and_not_by_a_wide_one() -> None:
    """A wall of 10 m by 0.5 m must leave room beside it."""
    wall = [(0.0, 0.0), (10.0, 0.0), (10.0, 0.5), (0.0, 0.5)]
    cylinders = cylinders_over(wall, 0.1)
    assert len(cylinders) == 6
    assert max(o.clearance for o in cylinders) < 1.0
    assert min(left_to(o, 5.0, 2.0, -1.0) for o in cylinders) > 0.5
