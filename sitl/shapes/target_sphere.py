"""The sphere that rides on the end-effector's target and holds the base (Case II)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from sitl.scenario import V3, Range, ScenarioZone
from sitl.shapes.ball import ball_nearest
from sitl.shapes.kind import ShapeKind


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSphere(ScenarioZone):
    """Within a radius of a place beside the target."""

    offset_m: Annotated[V3, Range(-10.0, 10.0)]  # from the target to the centre
    radius_m: Annotated[float, Range(0.001, 10.0)]
    clearance_m: Annotated[float, Range(0.0, 10.0)] = 0.0
    keep_in: bool = True
    shape: Literal["target sphere"] = "target sphere"

    def numbers(self, moved: V3) -> tuple[float, ...]:
        """Offset and radius; it moves with the target alone, and ``moved`` [m, NED] is zero."""
        return (*self.offset_m, self.radius_m)

    def problem(self) -> str | None:
        """Movement of its own, or nothing to hold."""
        if not self.keep_in:
            return "keep_in = false: a target sphere can only be kept in"
        if any(self.velocity_m_s) or self.way_points:
            return "a target sphere moves with the target: velocity_m_s and way_points must go"
        if not self.radius_m > self.clearance_m:
            return f"radius_m = {self.radius_m:g}: must be above clearance_m"
        return None


KIND = ShapeKind(number=2, table=TargetSphere, nearest=ball_nearest, follows_target=True)
