"""A ball, or with a radius of zero a point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from sitl.compiled import kernel
from sitl.plant.vector import Array
from sitl.scenario import V3, WORLD_M, Range, ScenarioZone
from sitl.shapes.kind import Nearest, ShapeKind


@dataclass(frozen=True, slots=True, kw_only=True)
class Ball(ScenarioZone):
    """Points within a radius of a centre."""

    centre_m: Annotated[V3, Range(-WORLD_M, WORLD_M)]
    radius_m: Annotated[float, Range(0.0, WORLD_M)]
    shape: Literal["ball"] = "ball"

    def numbers(self, moved: V3) -> tuple[float, ...]:
        """Centre, ``moved`` [m, NED], and radius."""
        (x, y, z), (dx, dy, dz) = self.centre_m, moved
        return (x + dx, y + dy, z + dz, self.radius_m)

    def problem(self) -> str | None:
        """There is none, unless nothing has room inside."""
        if self.keep_in and not self.radius_m > self.clearance_m:
            return f"radius_m = {self.radius_m:g}: must be above clearance_m with keep_in"
        return None


@kernel
def ball_nearest(numbers: Array, x: float, y: float, z: float) -> Nearest:
    """A point at x [m], y [m], z [m] of NED against a ball of ``numbers`` (16,) [m, NED]."""
    x, y, z = x - numbers[0], y - numbers[1], z - numbers[2]
    length = np.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return Nearest(-numbers[3], 1.0, 0.0, 0.0)
    return Nearest(length - numbers[3], x / length, y / length, z / length)


KIND = ShapeKind(number=1, table=Ball, nearest=ball_nearest)
