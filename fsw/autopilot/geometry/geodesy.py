"""Between the local frame and places on Earth.

Azimuthal equidistant projection on a sphere, the one that PX4, MAVSDK and QGroundControl compute
with: a client that projects a local point itself finds the place that the vehicle means.
Source: J. P. Snyder, Map Projections - A Working Manual, USGS 1395, 1987, p. 195.
"""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.signals import Origin, Vec3

EARTH_RADIUS: Final = 6_371_000.0  # m
# Where PX4's simulation flies, but at sea level: there "above the sea" and "above the origin" are
# the same number, which clients confuse.
DEFAULT_ORIGIN: Final = Origin(47.397742, 8.545594, 0.0)


def to_local(origin: Origin, latitude: float, longitude: float, altitude: float) -> Vec3:
    """North, east, down [m] from the origin of a place.

    It lies at a ``latitude`` [deg], north positive, a ``longitude`` [deg], east positive, and an
    ``altitude`` [m] above mean sea level.
    """
    lat0, lat = math.radians(origin.latitude), math.radians(latitude)
    east_by = math.radians(longitude - origin.longitude)
    x = math.cos(lat0) * math.sin(lat) - math.sin(lat0) * math.cos(lat) * math.cos(east_by)
    y = math.cos(lat) * math.sin(east_by)
    along = math.sin(lat0) * math.sin(lat) + math.cos(lat0) * math.cos(lat) * math.cos(east_by)
    # atan2 rather than acos: exact for the short distances at which a vehicle works.
    sine = math.hypot(x, y)
    scale = EARTH_RADIUS * (math.atan2(sine, along) / sine if sine > 0.0 else 1.0)
    return scale * x, scale * y, origin.altitude - altitude


def to_global(origin: Origin, p: Vec3) -> Vec3:
    """The place of a local point p [m, NED]: latitude and longitude [deg], altitude [m]."""
    distance = math.hypot(p[0], p[1])
    altitude = origin.altitude - p[2]
    if distance == 0.0:
        return origin.latitude, origin.longitude, altitude
    angle, lat0 = distance / EARTH_RADIUS, math.radians(origin.latitude)
    north, east = p[0] / distance, p[1] / distance
    sine, cosine = math.sin(angle), math.cos(angle)
    latitude = math.asin(cosine * math.sin(lat0) + north * sine * math.cos(lat0))
    east_by = math.atan2(east * sine, math.cos(lat0) * cosine - math.sin(lat0) * north * sine)
    longitude = origin.longitude + math.degrees(east_by)
    return math.degrees(latitude), (longitude + 180.0) % 360.0 - 180.0, altitude
