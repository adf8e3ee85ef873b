"""Where a command means: the places that MAVLink's frames can name, in the local frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.geometry.geodesy import to_local
from fsw.signals import CommandRequest, Home, Origin, Vec3

# MAV_FRAME; a COMMAND_LONG has none and means what GLOBAL means.
_GLOBAL = (0, 5)
_RELATIVE = (3, 6)
_LOCAL_NED = 1

# m from the origin; farther is a slip: of the frame, the unit or the sign.
FARTHEST = 1000.0


@dataclass(frozen=True, slots=True)
class Refused:
    """Why something is of no use."""

    reason: str


def height_of(request: CommandRequest, origin: Origin, home: Home | None) -> float | Refused | None:
    """Height above the origin that parameter 7 asks for [m]; None where it asks for none."""
    z = request.params[6]
    if math.isnan(z):
        return None
    if not math.isfinite(z):
        return Refused("the altitude is not finite")
    if request.frame is None or request.frame in _GLOBAL:
        return z - origin.altitude
    if request.frame in _RELATIVE:
        return z - (home.p[2] if home is not None else 0.0)
    if request.frame == _LOCAL_NED:
        return -z
    return Refused(f"frame {request.frame} is not supported; use global, relative or local NED")


def place_of(
    request: CommandRequest, origin: Origin, home: Home | None, here: Vec3
) -> Vec3 | Refused:
    """The place that parameters 5 to 7 name [m]; a NaN means: as here."""
    height = height_of(request, origin, home)
    if isinstance(height, Refused):
        return height
    down = here[2] if height is None else -height
    x, y = request.params[4:6]
    if math.isnan(x) and math.isnan(y):
        return here[0], here[1], down
    if not (math.isfinite(x) and math.isfinite(y)):
        return Refused("the place is not finite")
    if request.frame != _LOCAL_NED:
        if not (abs(x) <= 90.0 and abs(y) <= 180.0):
            return Refused(f"{x:g}, {y:g} is no latitude and longitude")
        x, y, _ = to_local(origin, x, y, origin.altitude)
    if not math.dist((x, y, down), (0.0, 0.0, 0.0)) <= FARTHEST:
        return Refused(f"the place is more than {FARTHEST:g} m from the origin")
    return x, y, down
