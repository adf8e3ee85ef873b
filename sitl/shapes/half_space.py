"""All that is behind a plane: a wall, the ground, a ceiling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from sitl.compiled import kernel
from sitl.plant.vector import Array
from sitl.ranges import normal_problem
from sitl.scenario import NORMAL, V3, WORLD_M, Range, ScenarioZone
from sitl.shapes.kind import Nearest, ShapeKind


@dataclass(frozen=True, slots=True, kw_only=True)
class HalfSpace(ScenarioZone):
    """Points p with n·p <= offset; the free side is in front."""

    normal: Annotated[V3, NORMAL]
    offset_m: Annotated[float, Range(-WORLD_M, WORLD_M)]
    shape: Literal["half-space"] = "half-space"

    def numbers(self, moved: V3) -> tuple[float, ...]:
        """Normal and offset, ``moved`` [m, NED]."""
        along = sum(n * m for n, m in zip(self.normal, moved, strict=True))
        return (*self.normal, self.offset_m + along)

    def problem(self) -> str | None:
        """A normal that is no unit vector."""
        return normal_problem(self.normal)


@kernel
def _nearest(numbers: Array, x: float, y: float, z: float) -> Nearest:
    nx, ny, nz = numbers[0], numbers[1], numbers[2]
    return Nearest(nx * x + ny * y + nz * z - numbers[3], nx, ny, nz)


KIND = ShapeKind(number=0, table=HalfSpace, nearest=_nearest, noun=" wall")
