"""What of a vehicle takes up space: rigid parts on the base and on the links, out of its file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from fsw.autopilot.signals import Vec3
from vehicles.description import Vehicle

ON_BASE = 0  # what a part is on; the link behind the k-th joint is k
_ORIGIN: Vec3 = (0.0, 0.0, 0.0)
_ROUNDED = 1e-9  # m


@dataclass(frozen=True, slots=True)
class Part:
    """One rigid part; ``begin`` and ``end`` are in the axes of what it is on.

    On the base these are the body's (FRD), on a link those of its joint's frame.
    """

    name: str
    on: int  # ON_BASE, or the number of a link
    begin: Vec3  # m; centre of a sphere or disc
    radius: float  # m, of a sphere or capsule; half the thickness of a disc
    end: Vec3 | None = None  # m; a capsule's other end
    rim: float = 0.0  # m, radius of a disc in the body's x-y plane
    tool: bool = False  # of the tool, which alone may touch what may be touched


def points_of(vehicle: Vehicle) -> tuple[Part, ...]:
    """The critical points, without a size."""
    points = [
        Part(point.name, vehicle.places[point.on], point.position, 0.0)
        for point in vehicle.critical_points
    ]
    return _origin_first(_with_tool(vehicle, points))


def parts_of(vehicle: Vehicle) -> tuple[Part, ...]:
    """The parts, a disc around all rotors, and spheres where a part ends or a critical point is.

    A sphere that another one of the same place holds is left out.
    """
    parts = [
        Part(one.name, vehicle.places[one.on], one.position, one.radius, one.end)
        for one in vehicle.parts
    ]
    for sphere in (*_ends(parts), *points_of(vehicle)):
        if not any(_holds(vehicle, part, sphere) for part in parts):
            parts.append(sphere)
    return _origin_first(_with_tool(vehicle, [*parts, _rotors(vehicle)]))


def _origin_first(parts: list[Part]) -> tuple[Part, ...]:
    """The part at the body's origin before all others: zones that follow the target ride on it."""
    at_origin = [
        part
        for part in parts
        if (part.on, part.begin, part.end, part.rim) == (ON_BASE, _ORIGIN, None, 0.0)
    ] or [Part("origin", ON_BASE, _ORIGIN, 0.0)]
    return (at_origin[0], *(part for part in parts if part is not at_origin[0]))


def _with_tool(vehicle: Vehicle, parts: list[Part]) -> list[Part]:
    """The parts, with those of the last link marked that have an end at the end-effector."""
    last, tip = len(vehicle.joints), vehicle.end_effector.position
    return [
        replace(part, tool=True)
        if part.on == last
        and min(math.dist(end, tip) for end in (part.begin, part.end or part.begin)) < _ROUNDED
        else part
        for part in parts
    ]


def _ends(parts: list[Part]) -> Iterator[Part]:
    for part in parts:
        if part.end is not None:
            yield replace(part, name=f"{part.name}_begin", end=None)
            yield replace(part, name=f"{part.name}_end", begin=part.end, end=None)


def _holds(vehicle: Vehicle, part: Part, sphere: Part) -> bool:
    """Whether a part is a sphere that holds another one, however the joints turn."""
    if part.end is not None:
        return False
    (on, place), (other, there) = _lowest(vehicle, part), _lowest(vehicle, sphere)
    return on == other and math.dist(place, there) + sphere.radius <= part.radius + _ROUNDED


def _lowest(vehicle: Vehicle, part: Part) -> tuple[int, Vec3]:
    """A place and what it is on; a joint's origin does not move with its own link."""
    on, place = part.on, part.begin
    while on != ON_BASE and place == _ORIGIN:
        on, place = on - 1, vehicle.joints[on - 1].xyz
    return on, place


def _rotors(vehicle: Vehicle) -> Part:
    """A disc along the body's x-y plane that holds what all rotors sweep."""
    rotors = vehicle.rotors
    x, y, z = (sum(rotor.position[k] for rotor in rotors) / len(rotors) for k in range(3))
    return Part(
        "rotors",
        ON_BASE,
        (x, y, z),
        max(
            abs(rotor.position[2] - z)
            + rotor.half_height * abs(rotor.axis[2])
            + rotor.radius * math.hypot(rotor.axis[0], rotor.axis[1])
            for rotor in rotors
        ),
        rim=max(
            math.hypot(rotor.position[0] - x, rotor.position[1] - y)
            + rotor.radius
            + rotor.half_height * math.hypot(rotor.axis[0], rotor.axis[1])
            for rotor in rotors
        ),
    )
