"""A cylinder in any direction with flat ends: a pipe, a beam."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from sitl.compiled import compilable, kernel
from sitl.plant.vector import Array, dot, scale, sub
from sitl.scenario import V3, WORLD_M, Range, ScenarioZone
from sitl.shapes.kind import Nearest, ShapeKind

_SHORTEST = 0.001  # m


@dataclass(frozen=True, slots=True, kw_only=True)
class Cylinder(ScenarioZone):
    """Within a radius of the line from a begin to an end."""

    begin_m: Annotated[V3, Range(-WORLD_M, WORLD_M)]
    end_m: Annotated[V3, Range(-WORLD_M, WORLD_M)]
    radius_m: Annotated[float, Range(0.001, WORLD_M)]
    shape: Literal["cylinder"] = "cylinder"

    def numbers(self, moved: V3) -> tuple[float, ...]:
        """Begin and end, ``moved`` [m, NED], and radius."""
        (bx, by, bz), (ex, ey, ez), (x, y, z) = self.begin_m, self.end_m, moved
        return (bx + x, by + y, bz + z, ex + x, ey + y, ez + z, self.radius_m)

    def problem(self) -> str | None:
        """A cylinder without length."""
        if math.dist(self.begin_m, self.end_m) >= _SHORTEST:
            return None
        return f"end_m = {list(self.end_m)}: must be at least {_SHORTEST:g} m from begin_m"


@compilable
def cylinder_nearest(middle: V3, axis: V3, half: float, radius: float, p: V3) -> Nearest:
    """A point p [m, NED] against a cylinder about ``middle`` [m, NED] along ``axis`` [1, NED].

    It reaches ``half`` [m] to either end and ``radius`` [m] to the side.
    """
    away = sub(p, middle)
    along = dot(away, axis)
    across = sub(away, scale(along, axis))
    distance = np.sqrt(dot(across, across))
    side = (0.0, 0.0, 0.0)
    if distance > 0.0:
        side = scale(1.0 / distance, across)
    elif abs(axis[0]) < 0.7:  # on the axis any direction across it is as near
        side = sub((1.0, 0.0, 0.0), scale(axis[0], axis))
        side = scale(1.0 / np.sqrt(dot(side, side)), side)
    else:
        side = sub((0.0, 1.0, 0.0), scale(axis[1], axis))
        side = scale(1.0 / np.sqrt(dot(side, side)), side)
    ahead = 1.0 if along >= 0.0 else -1.0
    aside, beyond = distance - radius, abs(along) - half
    if aside > 0.0 and beyond > 0.0:
        rim = np.sqrt(aside * aside + beyond * beyond)
        s, e = aside / rim, ahead * beyond / rim
        return Nearest(
            rim,
            s * side[0] + e * axis[0],
            s * side[1] + e * axis[1],
            s * side[2] + e * axis[2],
        )
    if aside >= beyond:
        return Nearest(aside, side[0], side[1], side[2])
    return Nearest(beyond, ahead * axis[0], ahead * axis[1], ahead * axis[2])


@kernel
def _nearest(numbers: Array, x: float, y: float, z: float) -> Nearest:
    ax, ay, az = numbers[3] - numbers[0], numbers[4] - numbers[1], numbers[5] - numbers[2]
    length = np.sqrt(ax * ax + ay * ay + az * az)
    middle = (numbers[0] + 0.5 * ax, numbers[1] + 0.5 * ay, numbers[2] + 0.5 * az)
    axis = (ax / length, ay / length, az / length)
    return cylinder_nearest(middle, axis, 0.5 * length, numbers[6], (x, y, z))


KIND = ShapeKind(number=4, table=Cylinder, nearest=_nearest)
