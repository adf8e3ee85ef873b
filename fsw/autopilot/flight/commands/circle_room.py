"""Whether the body has room on all of a circle: its zones are looked at in one compiled call."""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.model.body import Body, Hull, hull_of, hull_reach_at
from fsw.autopilot.shapes.zones import FOLLOWS, Array, all_moving_zones, nearest_plane
from fsw.autopilot.signals import SafeSet, Vec3
from fsw.compiled import compilable, kernel, machine_code

_PLACES: Final = 64  # looked at, before the nearest is sought


@compilable
def _room(zones: Array, zone: int, p: Vec3, hull: Hull, t_us: int) -> float:
    at = nearest_plane(zones, zone, p, t_us)
    return at.distance - hull_reach_at(hull, (at.nx, at.ny, at.nz))


@kernel
def _too_close(zones: Array, centre: Vec3, radius: float, hull: Hull, t_us: int) -> int:
    up, down = hull_reach_at(hull, (0.0, 0.0, -1.0)), hull_reach_at(hull, (0.0, 0.0, 1.0))
    farthest = radius + hull_reach_at(hull, (1.0, 0.0, 0.0)) + max(up, down)
    x, y, z = centre
    for zone in range(len(zones)):
        # No place on the circle is nearer by more than its radius.
        far = nearest_plane(zones, zone, centre, t_us).distance > farthest
        if far or zones[zone, FOLLOWS] > 0.0:
            continue
        # The nearest of some places on the circle, then of as many between its neighbours.
        apart, best, least = math.pi, 0.0, math.inf
        for _ in range(2):
            begin, apart, least = best - apart, 2.0 * apart / _PLACES, math.inf
            for k in range(_PLACES + 1):
                angle = begin + apart * k
                place = (x + radius * math.cos(angle), y + radius * math.sin(angle), z)
                room = _room(zones, zone, place, hull, t_us)
                if room < least:
                    best, least = angle, room
        if not least > 0.0:
            return zone
    return -1


_first_too_close = machine_code(_too_close)


def circle_too_close(
    centre: Vec3, radius: float, safe_set: SafeSet, body: Body, t_us: int
) -> int | None:
    """The first zone that a circle of ``radius`` [m] about ``centre`` [m, NED] comes too close to.

    None: there is room for the ``body`` on all of it.
    """
    zone = _first_too_close(all_moving_zones(safe_set), centre, radius, hull_of(body), t_us)
    return None if zone < 0 else zone
