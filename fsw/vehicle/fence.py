"""A fence as ground stations upload it, read into the safe set that the barriers keep.

===========================  ==================================================================
item                         here
===========================  ==================================================================
polygon, inclusion           one wall an edge, upright, kept by base, second joint, end-effector
circle, inclusion            eight walls, the regular octagon inside the circle
circle in frame 7            the sphere that rides with the end-effector's target and holds the
(MAV_FRAME_LOCAL_OFFSET_NED) base: x, y, z from target to centre, radius
exclusion of either kind     refused: what is outside a shape is not convex
===========================  ==================================================================

Free space is the intersection of half-spaces: a polygon that is not convex cannot be told.
"""

from __future__ import annotations

import math
from typing import Final

from fsw.signals import SafeSet, Vec2, Wall, WorkspaceSphere
from fsw.vehicle.mission_items import (
    INVALID,
    INVALID_PARAM1,
    LOCAL_OFFSET_NED,
    UNSUPPORTED,
    Locate,
    MissionItem,
    Refused,
    horizontal_place,
)

RETURN_POINT: Final = 5000  # MAV_CMD_NAV_FENCE_RETURN_POINT
POLYGON_INCLUSION: Final = 5001
POLYGON_EXCLUSION: Final = 5002
CIRCLE_INCLUSION: Final = 5003
CIRCLE_EXCLUSION: Final = 5004

MOST_WALLS: Final = 16
_CIRCLE_WALLS: Final = 8
_SHORTEST_EDGE: Final = 0.05  # m

_REASONS: Final = {
    RETURN_POINT: "a fence has no return point here: the barriers keep the vehicle inside",
    POLYGON_EXCLUSION: "an exclusion cannot be kept: the free space around it is not convex",
    CIRCLE_EXCLUSION: "an exclusion cannot be kept: the free space around it is not convex",
}


def read_fence(
    items: tuple[MissionItem, ...], locate: Locate, clearance: float
) -> SafeSet | Refused:
    """The safe set of a whole fence.

    Args:
        items: As uploaded; the vertices of a polygon follow one another.
        locate: Of places on Earth.
        clearance: Distance that every critical point keeps from a wall [m].
    """
    walls: list[Wall] = []
    sphere: WorkspaceSphere | None = None
    at = 0
    while at < len(items):
        item = items[at]
        size = _vertex_count(item)
        if size > len(items) - at:
            return Refused(INVALID, f"a polygon of {size} vertices has {len(items) - at}")
        shape = _shape(items[at : at + size], locate, clearance)
        if isinstance(shape, Refused):
            return shape
        if isinstance(shape, WorkspaceSphere):
            if sphere is not None:
                return Refused(INVALID, "there can be one workspace sphere")
            sphere = shape
        else:
            walls += shape
        at += size
    if walls and sphere is not None:
        return Refused(INVALID, "walls and a workspace sphere cannot be kept at once")
    if len(walls) > MOST_WALLS:
        return Refused(INVALID, f"a fence of {len(walls)} walls; {MOST_WALLS} can be kept")
    return SafeSet(tuple(walls), sphere)


def read_fence_item(item: MissionItem, locate: Locate) -> Refused | None:
    """What is wrong with one item by itself."""
    if item.command == CIRCLE_INCLUSION and item.frame == LOCAL_OFFSET_NED:
        sphere = _sphere(item)
        return sphere if isinstance(sphere, Refused) else None
    if item.command not in (POLYGON_INCLUSION, CIRCLE_INCLUSION):
        unknown = f"command {item.command} is no fence of this vehicle"
        return Refused(UNSUPPORTED, _REASONS.get(item.command, unknown))
    place = horizontal_place(item, locate)
    if isinstance(place, Refused):
        return place
    number = item.params[0]
    if item.command == CIRCLE_INCLUSION and not 0.0 < number < math.inf:
        return Refused(INVALID_PARAM1, f"a circle of radius {number:g} m")
    if item.command == POLYGON_INCLUSION and not 3.0 <= number <= MOST_WALLS:
        return Refused(INVALID_PARAM1, f"a polygon of {number:g} vertices; 3 to {MOST_WALLS} do")
    return None


def _vertex_count(item: MissionItem) -> int:
    count = item.params[0]
    return int(count) if item.command == POLYGON_INCLUSION and count >= 1.0 else 1


def _shape(
    items: tuple[MissionItem, ...], locate: Locate, clearance: float
) -> list[Wall] | WorkspaceSphere | Refused:
    """One polygon, circle or sphere."""
    for item in items:
        wrong = read_fence_item(item, locate)
        if wrong is not None:
            return wrong
        if (item.command, item.params[0]) != (items[0].command, items[0].params[0]):
            return Refused(INVALID, "the vertices of a polygon do not agree on their number")
    first = items[0]
    if first.command == CIRCLE_INCLUSION and first.frame == LOCAL_OFFSET_NED:
        return _sphere(first)
    places: list[Vec2] = []
    for item in items:
        place = horizontal_place(item, locate)
        if isinstance(place, Refused):
            return place
        places.append(place)
    if first.command == CIRCLE_INCLUSION:
        return walls_of(_octagon(places[0], first.params[0]), clearance)
    return walls_of(places, clearance)


def walls_of(corners: list[Vec2], clearance: float) -> list[Wall] | Refused:
    """Upright walls along the edges of a convex polygon, normals inward.

    Args:
        corners: North and east [m], in either sense of rotation.
        clearance: Of each wall [m].
    """
    edges = list(zip(corners, corners[1:] + corners[:1], strict=True))
    if any(math.dist(a, b) < _SHORTEST_EDGE for a, b in edges):
        return Refused(INVALID, f"a polygon with an edge shorter than {_SHORTEST_EDGE:g} m")
    area = 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in edges)
    if not abs(area) > _SHORTEST_EDGE**2:
        return Refused(INVALID, "a polygon without an inside")
    sense = 1.0 if area > 0.0 else -1.0  # 1: clockwise as seen from above
    walls = []
    for a, b in edges:
        length = math.dist(a, b)
        # Right of the way from a to b, for a polygon that turns right.
        normal = (-sense * (b[1] - a[1]) / length, sense * (b[0] - a[0]) / length, 0.0)
        offset = normal[0] * a[0] + normal[1] * a[1]
        if any(normal[0] * c[0] + normal[1] * c[1] < offset - 1e-3 for c in corners):
            return Refused(INVALID, "the polygon is not convex: its inside is no safe set here")
        walls.append(Wall(normal, offset, clearance))
    return walls


def _octagon(centre: Vec2, radius: float) -> list[Vec2]:
    angles = [2.0 * math.pi * k / _CIRCLE_WALLS for k in range(_CIRCLE_WALLS)]
    return [
        (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle))
        for angle in angles
    ]


def _sphere(item: MissionItem) -> WorkspaceSphere | Refused:
    if not 0.0 < item.params[0] < math.inf:
        return Refused(INVALID_PARAM1, f"a sphere of radius {item.params[0]:g} m")
    if not math.isfinite(item.z):
        return Refused(INVALID_PARAM1 + 6, "a sphere needs the height of its centre")
    return WorkspaceSphere((1e-4 * item.x, 1e-4 * item.y, item.z), item.params[0])
