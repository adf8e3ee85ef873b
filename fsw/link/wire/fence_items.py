"""A geofence as ground stations upload it, read into the safe set that the barriers keep.

===========================  ==================================================================
item                         here
===========================  ==================================================================
polygon, inclusion           one wall an edge, upright, kept by all that is to keep clear
circle, inclusion            eight walls, the regular octagon inside the circle
polygon, exclusion           upright cylinders that cover it, as wide as it needs
circle, exclusion            an upright cylinder
return point                 kept for who downloads it; the barriers keep the vehicle inside, so
                             there is no breach to return from
circle in frame 7            the sphere that rides with the end-effector's target and holds the
(MAV_FRAME_LOCAL_OFFSET_NED) base: x, y, z from target to centre, radius
===========================  ==================================================================

Free space inside is an intersection of half-spaces: a polygon of inclusion that is not convex is
refused. One of exclusion may have any shape; what its cylinders cover in addition is kept off too.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

from fsw.autopilot.shapes.half_space import KIND as HALF_SPACE
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.vertical_cylinder import KIND as VERTICAL_CYLINDER
from fsw.autopilot.shapes.vertical_cylinder import column
from fsw.autopilot.signals import TARGET_SPHERE, SafeSet, Vec2, Zone
from fsw.link.wire.mission_items import (
    INVALID,
    INVALID_PARAM1,
    LOCAL_OFFSET_NED,
    UNSUPPORTED,
    BadItem,
    Locate,
    MissionItem,
    command_name,
    horizontal_place,
)

RETURN_POINT: Final = 5000  # MAV_CMD_NAV_FENCE_RETURN_POINT
POLYGON_INCLUSION: Final = 5001
POLYGON_EXCLUSION: Final = 5002
CIRCLE_INCLUSION: Final = 5003
CIRCLE_EXCLUSION: Final = 5004

MAX_WALLS: Final = 16
_CIRCLE_WALLS: Final = 8
MAX_CYLINDERS: Final = 16
_CYLINDERS_OF_ONE: Final = 6  # that a polygon is covered with at most
_SHORTEST_EDGE: Final = 0.05  # m
_ORDER: Final = (HALF_SPACE.name, VERTICAL_CYLINDER.name, TARGET_SPHERE)  # of the zones

_POLYGONS: Final = (POLYGON_INCLUSION, POLYGON_EXCLUSION)
_CIRCLES: Final = (CIRCLE_INCLUSION, CIRCLE_EXCLUSION)


def read_fence(items: tuple[MissionItem, ...], locate: Locate, clearance: float) -> SafeSet:
    """The safe set of a whole fence, whose walls keep a ``clearance`` [m] from critical points.

    The vertices of a polygon follow one another.
    """
    zones: list[Zone] = []
    at = 0
    while at < len(items):
        item = items[at]
        polygon = item.command in _POLYGONS and item.params[0] >= 1.0
        size = int(item.params[0]) if polygon else 1
        if size > len(items) - at:
            raise BadItem(INVALID, f"a polygon of {size} vertices has {len(items) - at}")
        at += size
        if item.command == RETURN_POINT:
            continue
        zones += _zones(items[at - size : at], locate, clearance)
    zones.sort(key=lambda zone: _ORDER.index(zone.shape.kind))
    for kind, most, what in (
        (HALF_SPACE.name, MAX_WALLS, "walls"),
        (VERTICAL_CYLINDER.name, MAX_CYLINDERS, "cylinders of exclusion"),
        (TARGET_SPHERE, 1, "workspace spheres"),
    ):
        count = sum(zone.shape.kind == kind for zone in zones)
        if count > most:
            raise BadItem(INVALID, f"a fence of {count} {what}; {most} can be kept")
    return SafeSet(tuple(zones))


def check_fence_item(item: MissionItem, locate: Locate) -> None:
    """Refuse an item that is wrong by itself."""
    if item.command == CIRCLE_INCLUSION and item.frame == LOCAL_OFFSET_NED:
        _sphere(item)
        return
    if item.command not in (*_POLYGONS, *_CIRCLES, RETURN_POINT):
        raise BadItem(UNSUPPORTED, f"{command_name(item.command)} is no fence of this vehicle")
    horizontal_place(item, locate)
    number = item.params[0]
    if item.command in _CIRCLES and not 0.0 < number < math.inf:
        raise BadItem(INVALID_PARAM1, f"a circle of radius {number:g} m")
    if item.command in _POLYGONS and not 3.0 <= number <= MAX_WALLS:
        raise BadItem(INVALID_PARAM1, f"a polygon of {number:g} vertices; 3 to {MAX_WALLS} do")


def _zones(items: tuple[MissionItem, ...], locate: Locate, clearance: float) -> list[Zone]:
    """Of one polygon, circle or sphere."""
    for item in items:
        check_fence_item(item, locate)
        if (item.command, item.params[0]) != (items[0].command, items[0].params[0]):
            raise BadItem(INVALID, "the vertices of a polygon do not agree on their number")
    first = items[0]
    if first.command == CIRCLE_INCLUSION and first.frame == LOCAL_OFFSET_NED:
        return [_sphere(first)]
    places = [horizontal_place(item, locate) for item in items]
    if first.command == CIRCLE_INCLUSION:
        return walls_of(_octagon(places[0], first.params[0]), clearance)
    if first.command == CIRCLE_EXCLUSION:
        return [column(places[0], first.params[0] + clearance)]
    if first.command == POLYGON_EXCLUSION:
        return cylinders_over(places, clearance)
    return walls_of(places, clearance)


def walls_of(corners: list[Vec2], clearance: float) -> list[Zone]:
    """Upright walls with a ``clearance`` [m] along the edges of a convex polygon, normals inward.

    The corners, north and east [m], may go round in either sense.
    """
    edges = list(zip(corners, corners[1:] + corners[:1], strict=True))
    if any(math.dist(a, b) < _SHORTEST_EDGE for a, b in edges):
        raise BadItem(INVALID, f"a polygon with an edge shorter than {_SHORTEST_EDGE:g} m")
    area = 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in edges)
    if not abs(area) > _SHORTEST_EDGE**2:
        raise BadItem(INVALID, "a polygon without an inside")
    sense = 1.0 if area > 0.0 else -1.0  # 1: clockwise as seen from above
    walls = []
    for a, b in edges:
        length = math.dist(a, b)
        # Right of the way from a to b, for a polygon that turns right.
        normal = (-sense * (b[1] - a[1]) / length, sense * (b[0] - a[0]) / length, 0.0)
        offset = normal[0] * a[0] + normal[1] * a[1]
        if any(normal[0] * c[0] + normal[1] * c[1] < offset - 1e-3 for c in corners):
            raise BadItem(INVALID, "the polygon is not convex: its inside is no safe set here")
        walls.append(wall(normal, offset, clearance))
    return walls


def cylinders_over(corners: list[Vec2], clearance: float) -> list[Zone]:
    """Upright cylinders that cover a polygon of any shape, and a ``clearance`` [m] around it.

    The polygon is cut across its long side into pieces about as long as it is wide, and each piece
    is covered by one cylinder about the middle of its bounding box.
    """
    along = _long_direction(corners)
    across = (-along[1], along[0])
    turned = [(_dot(c, along), _dot(c, across)) for c in corners]
    first, last = min(u for u, _ in turned), max(u for u, _ in turned)
    width = max(v for _, v in turned) - min(v for _, v in turned)
    length = last - first
    count = min(max(round(length / max(width, _SHORTEST_EDGE)), 1), _CYLINDERS_OF_ONE)
    cylinders = []
    # No cut at the ends: rounded, it would cut corners off.
    cuts = [-math.inf, *(first + k * length / count for k in range(1, count)), math.inf]
    for low, high in pairwise(cuts):
        piece = _between(turned, low, high)
        if not piece:
            continue
        u = 0.5 * (min(p[0] for p in piece) + max(p[0] for p in piece))
        v = 0.5 * (min(p[1] for p in piece) + max(p[1] for p in piece))
        radius = max(math.dist((u, v), p) for p in piece)
        centre = (u * along[0] + v * across[0], u * along[1] + v * across[1])
        cylinders.append(column(centre, radius + clearance))
    return cylinders


def _long_direction(corners: list[Vec2]) -> Vec2:
    """Unit vector along the edge in whose direction the polygon's bounding box is smallest."""
    directions = []
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        length = math.dist(a, b)
        if length > 0.0:
            directions.append(((b[0] - a[0]) / length, (b[1] - a[1]) / length))
    best, smallest = (1.0, 0.0), math.inf
    for d in directions:
        along = [_dot(c, d) for c in corners]
        across = [_dot(c, (-d[1], d[0])) for c in corners]
        sides = max(along) - min(along), max(across) - min(across)
        if sides[0] * sides[1] < smallest:
            smallest = sides[0] * sides[1]
            best = d if sides[0] >= sides[1] else (-d[1], d[0])
    return best


def _between(corners: list[Vec2], low: float, high: float) -> list[Vec2]:
    """The part of a polygon whose first coordinate is between two values (Sutherland-Hodgman)."""
    for bound, sense in ((low, 1.0), (high, -1.0)):
        kept: list[Vec2] = []
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            inside_a, inside_b = sense * (a[0] - bound) >= 0.0, sense * (b[0] - bound) >= 0.0
            if inside_a:
                kept.append(a)
            if inside_a != inside_b:
                share = (bound - a[0]) / (b[0] - a[0])
                kept.append((bound, a[1] + share * (b[1] - a[1])))
        corners = kept
    return corners


def _dot(a: Vec2, b: Vec2) -> float:
    return a[0] * b[0] + a[1] * b[1]


def _octagon(centre: Vec2, radius: float) -> list[Vec2]:
    angles = [2.0 * math.pi * k / _CIRCLE_WALLS for k in range(_CIRCLE_WALLS)]
    return [
        (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle))
        for angle in angles
    ]


def _sphere(item: MissionItem) -> Zone:
    if not 0.0 < item.params[0] < math.inf:
        raise BadItem(INVALID_PARAM1, f"a sphere of radius {item.params[0]:g} m")
    if not math.isfinite(item.z):
        raise BadItem(INVALID_PARAM1 + 6, "a sphere needs the height of its centre")
    return target_sphere((1e-4 * item.x, 1e-4 * item.y, item.z), item.params[0])
