"""Where on Earth a point of the local frame is.

The azimuthal equidistant projection on a sphere, as PX4's own simulators have it.

Source: J. P. Snyder, Map Projections - A Working Manual, USGS 1395, 1987, p. 195.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from sitl.ranges import V3

RADIUS: Final = 6_371_000.0  # m


class Place(NamedTuple):
    """A place on Earth."""

    latitude: float  # deg
    longitude: float  # deg
    altitude: float  # m above mean sea level


# That of the flight software: where PX4's simulators fly, at sea level.
DEFAULT_ORIGIN: Final = Place(47.397742, 8.545594, 0.0)


def place_of(origin: Place, p: V3) -> Place:
    """The place of a local point p [m, NED]."""
    north, east, down = p
    angle = math.hypot(north, east) / RADIUS
    bearing = math.atan2(east, north)
    begin = math.radians(origin.latitude)
    # Towards the bearing on a great circle, as a unit vector that is taken apart again.
    s, c = math.sin(angle), math.cos(angle)
    up = math.sin(begin) * c + math.cos(begin) * s * math.cos(bearing)
    ahead = math.cos(begin) * c - math.sin(begin) * s * math.cos(bearing)
    across = s * math.sin(bearing)
    return Place(
        math.degrees(math.atan2(up, math.hypot(ahead, across))),
        origin.longitude + math.degrees(math.atan2(across, ahead)),
        origin.altitude - down,
    )
