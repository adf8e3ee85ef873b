"""An upright cylinder with flat ends: a column, a person."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from sitl.compiled import kernel
from sitl.plant.vector import Array
from sitl.scenario import V2, V3, WORLD_M, Range, ScenarioZone
from sitl.shapes.cylinder import cylinder_nearest
from sitl.shapes.kind import Nearest, ShapeKind


@dataclass(frozen=True, slots=True, kw_only=True)
class VerticalCylinder(ScenarioZone):
    """Within a radius of an upright line, from a top down to a bottom."""

    north_east_m: Annotated[V2, Range(-WORLD_M, WORLD_M)]
    radius_m: Annotated[float, Range(0.0, WORLD_M)]
    top_m: Annotated[float, Range(-WORLD_M, WORLD_M)] = -WORLD_M  # NED: down is positive
    bottom_m: Annotated[float, Range(-WORLD_M, WORLD_M)] = WORLD_M
    shape: Literal["vertical cylinder"] = "vertical cylinder"

    def numbers(self, moved: V3) -> tuple[float, ...]:
        """Axis, top and bottom, ``moved`` [m, NED], and radius."""
        (n, e), (dn, de, dd) = self.north_east_m, moved
        return (n + dn, e + de, self.top_m + dd, self.bottom_m + dd, self.radius_m)

    def problem(self) -> str | None:
        """A cylinder without height."""
        if self.bottom_m > self.top_m:
            return None
        return f"bottom_m = {self.bottom_m:g}: must be below top_m = {self.top_m:g} (z is down)"


@kernel
def _nearest(numbers: Array, x: float, y: float, z: float) -> Nearest:
    middle = (numbers[0], numbers[1], 0.5 * (numbers[2] + numbers[3]))
    half = 0.5 * (numbers[3] - numbers[2])
    return cylinder_nearest(middle, (0.0, 0.0, 1.0), half, numbers[4], (x, y, z))


KIND = ShapeKind(number=3, table=VerticalCylinder, nearest=_nearest)
