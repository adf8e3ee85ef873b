"""The place of a part of the body that is nearest to a zone: for the planner, margins, the filter.

Between two places the distance to a convex shape to keep out of is convex, so tangents find the
least. Across a disc the search goes down the slope, each time to the nearest place of the way.
"""

from __future__ import annotations

import math

from fsw.autopilot.geometry.vectors import add_scaled, dot
from fsw.autopilot.model.body import BEGIN, CAPSULE, DISC, END, FORM, ON, RIM, TURN, Probes
from fsw.autopilot.model.kinematics import Frame, in_axes, position
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.shapes.kind import Surface
from fsw.autopilot.shapes.zones import FLAT, KEEP_IN, Zones, surface_at
from fsw.autopilot.signals import Vec3
from fsw.compiled import kernel

_NEAREST_STEPS = 8  # at most, between two places
_DISC_STEPS = 8  # at most, across a disc
_EXACT = 1e-4  # m, by which a distance may be too long
_LEVEL = 1e-9  # slope across a disc that is none
_STILL = 1e-4  # m, a step that is none
_AXIAL = 0.7  # cosine between a disc's axis and a normal from which all of its rim counts


@kernel
def nearest_place(
    zones: Zones, zone: int, which: int, shift: Vec3, probes: Probes, probe: int, frame: Frame
) -> tuple[Vec3, Surface, bool]:
    """The place of a probe that counts against a plane of a zone, and that plane.

    The zone is moved by ``shift`` [m, NED]; ``which`` of the planes. The place is given where it is
    on its part [m]. False: this probe says nothing that another does not say.
    """
    form = probes[probe, FORM]
    if form == CAPSULE:
        return _nearest_on_capsule(zones, zone, which, shift, probes[probe], frame)
    if form == DISC:
        return _nearest_on_disc(zones, zone, which, shift, probes[probe], frame)
    begin = (probes[probe, BEGIN], probes[probe, BEGIN + 1], probes[probe, BEGIN + 2])
    x = position(frame, int(probes[probe, ON]), begin)
    return begin, _seen(zones, zone, which, shift, x), True


@kernel
def _nearest_on_capsule(
    zones: Zones, zone: int, which: int, shift: Vec3, probe: Array, frame: Frame
) -> tuple[Vec3, Surface, bool]:
    begin = (probe[BEGIN], probe[BEGIN + 1], probe[BEGIN + 2])
    end = (probe[END], probe[END + 1], probe[END + 2])
    first = position(frame, int(probe[ON]), begin)
    last = position(frame, int(probe[ON]), end)
    if zones[zone, FLAT] > 0.0 or zones[zone, KEEP_IN] > 0.0:
        # Then an end is nearest, which is a sphere of another part.
        at, other = _seen(zones, zone, which, shift, first), _seen(zones, zone, which, shift, last)
        return (begin, at, False) if at.distance <= other.distance else (end, other, False)
    share, at = _nearest_between(zones, zone, shift, first, last)
    local = (
        begin[0] + share * (end[0] - begin[0]),
        begin[1] + share * (end[1] - begin[1]),
        begin[2] + share * (end[2] - begin[2]),
    )
    return local, at, 0.0 < share < 1.0


@kernel
def _nearest_between(
    zones: Zones, zone: int, shift: Vec3, first: Vec3, last: Vec3
) -> tuple[float, Surface]:
    """Where between two places of the world a zone to keep out of is nearest, as a share.

    The distance is convex along the way, so the tangents at two places cross below the least: there
    it is looked at next, until nothing is to be gained.
    """
    way = (last[0] - first[0], last[1] - first[1], last[2] - first[2])
    a, at = 0.0, _seen(zones, zone, 0, shift, first)
    at_a, slope_a = at.distance, dot((at.nx, at.ny, at.nz), way)
    if slope_a >= 0.0:
        return 0.0, at
    b, at = 1.0, _seen(zones, zone, 0, shift, last)
    at_b, slope_b = at.distance, dot((at.nx, at.ny, at.nz), way)
    share = 1.0
    if slope_b <= 0.0:
        return 1.0, at
    for _ in range(_NEAREST_STEPS):
        share = (at_b - at_a + slope_a * a - slope_b * b) / (slope_a - slope_b)
        least = at_a + slope_a * (share - a)
        at = _seen(zones, zone, 0, shift, add_scaled(first, way, share))
        if at.distance - least < _EXACT:
            break
        slope = dot((at.nx, at.ny, at.nz), way)
        if slope > 0.0:
            b, at_b, slope_b = share, at.distance, slope
        else:
            a, at_a, slope_a = share, at.distance, slope
    return share, at


@kernel
def _nearest_on_disc(
    zones: Zones, zone: int, which: int, shift: Vec3, probe: Array, frame: Frame
) -> tuple[Vec3, Surface, bool]:
    begin, rim = (probe[BEGIN], probe[BEGIN + 1], probe[BEGIN + 2]), probe[RIM]
    on, at_rim = int(probe[ON]), zones[zone, FLAT] > 0.0 or zones[zone, KEEP_IN] > 0.0
    local = begin
    x = position(frame, on, local)
    at = _seen(zones, zone, which, shift, x)
    n1, n2, n3 = in_axes(frame, (at.nx, at.ny, at.nz))
    if probe[TURN] > 0.0 and abs(n3) < 0.5 * _AXIAL:
        return local, at, False
    u = v = 0.0  # of the place, from the disc's centre
    step = 1e3  # m: first to the rim, then along it
    for _ in range(_DISC_STEPS):
        level = math.sqrt(n1 * n1 + n2 * n2)
        if level < _LEVEL:
            break
        # Down the slope, back onto the disc, and of that way as far as it goes down.
        way_u, way_v = u - step * n1 / level, v - step * n2 / level
        scale = min(rim / math.sqrt(way_u * way_u + way_v * way_v), 1.0)
        way_u, way_v = way_u * scale - u, way_v * scale - v
        if not at_rim:  # inside, the distance is concave: its slope leads to a lesser place in full
            step = min(step, 2.0 * rim) * 0.5
        aim = position(frame, on, (begin[0] + u + way_u, begin[1] + v + way_v, begin[2]))
        share = 1.0
        if at_rim:
            at = _seen(zones, zone, which, shift, aim)
        else:
            share, at = _nearest_between(zones, zone, shift, x, aim)
        u, v = u + share * way_u, v + share * way_v
        local = (begin[0] + u, begin[1] + v, begin[2])
        x = position(frame, on, local)
        n1, n2, n3 = in_axes(frame, (at.nx, at.ny, at.nz))
        if share * (abs(way_u) + abs(way_v)) < _STILL or zones[zone, FLAT] > 0.0:
            break
    if probe[TURN] == 0.0:
        return local, at, True
    if abs(n3) < _AXIAL:
        return local, at, False
    angle = math.atan2(v, u) + probe[TURN]
    local = (begin[0] + rim * math.cos(angle), begin[1] + rim * math.sin(angle), begin[2])
    return local, _seen(zones, zone, which, shift, position(frame, on, local)), True


@kernel
def _seen(zones: Zones, zone: int, which: int, shift: Vec3, x: Vec3) -> Surface:
    """The plane of a zone near a place in the world."""
    return surface_at(zones, zone, which, x[0] - shift[0], x[1] - shift[1], x[2] - shift[2])
