"""A box in any attitude: a shelf, a beam, a room from inside."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from sitl.compiled import compilable, kernel
from sitl.plant.vector import V4, Array
from sitl.scenario import V3, WORLD_M, Range, ScenarioZone
from sitl.shapes.kind import Nearest, ShapeKind


@dataclass(frozen=True, slots=True, kw_only=True)
class Box(ScenarioZone):
    """Half a size along each of its own axes to either side of a centre."""

    centre_m: Annotated[V3, Range(-WORLD_M, WORLD_M)]
    half_size_m: Annotated[V3, Range(0.001, WORLD_M)]
    # Roll, pitch and yaw: from its axes to NED by x, then y, then z of the world.
    attitude_deg: Annotated[V3, Range(-180.0, 180.0)] = (0.0, 0.0, 0.0)
    shape: Literal["box"] = "box"

    def numbers(self, moved: V3) -> tuple[float, ...]:
        """Centre, ``moved`` [m, NED], half size and attitude as a quaternion."""
        (x, y, z), (dx, dy, dz) = self.centre_m, moved
        return (x + dx, y + dy, z + dz, *self.half_size_m, *_quaternion(self.attitude_deg))

    def problem(self) -> str | None:
        """There is none, unless nothing has room inside."""
        if self.keep_in and not min(self.half_size_m) > self.clearance_m:
            return f"half_size_m = {list(self.half_size_m)}: must be above clearance_m with keep_in"
        return None


def _quaternion(attitude_deg: V3) -> V4:
    """w, x, y, z of roll, pitch and yaw [deg]."""
    roll, pitch, yaw = (0.5 * math.radians(angle) for angle in attitude_deg)
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@compilable
def _column(numbers: Array, k: int) -> V3:
    """Axis ``k`` of the box in NED."""
    w, x, y, z = numbers[6], numbers[7], numbers[8], numbers[9]
    if k == 0:
        return (w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))
    if k == 1:
        return (2.0 * (x * y - w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z + w * x))
    return (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z)


@kernel
def _nearest(numbers: Array, x: float, y: float, z: float) -> Nearest:
    x, y, z = x - numbers[0], y - numbers[1], z - numbers[2]
    nx = ny = nz = square = 0.0
    least, face, sign = -np.inf, 0, 1.0
    for k in range(3):
        a = _column(numbers, k)
        along = a[0] * x + a[1] * y + a[2] * z
        towards = 1.0 if along >= 0.0 else -1.0
        beyond = abs(along) - numbers[3 + k]
        if beyond > least:
            least, face, sign = beyond, k, towards
        if beyond > 0.0:
            square += beyond * beyond
            nx += towards * beyond * a[0]
            ny += towards * beyond * a[1]
            nz += towards * beyond * a[2]
    if square > 0.0:
        away = np.sqrt(square)
        return Nearest(away, nx / away, ny / away, nz / away)
    a = _column(numbers, face)
    return Nearest(least, sign * a[0], sign * a[1], sign * a[2])


KIND = ShapeKind(number=5, table=Box, nearest=_nearest)
