"""What a file of this folder provides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from sitl.plant.vector import Array
from sitl.scenario import ScenarioZone

NUMBERS = 16  # room of OBSTACLE_SHAPE


class Nearest(NamedTuple):
    """Where a point stands against a shape."""

    distance: float  # m, to the surface; negative inside
    nx: float  # outward unit normal where the shape is nearest, NED
    ny: float
    nz: float


NearestOf = Callable[[Array, float, float, float], Nearest]
"""From numbers (16,) and x, y, z [m, NED]; exact, convex in the place, compiled."""


@dataclass(frozen=True, slots=True)
class ShapeKind:
    """One kind of convex shape."""

    number: int  # PANDION_SHAPE
    table: type[ScenarioZone]  # in a scenario
    nearest: NearestOf
    noun: str = ""  # what a sentence adds to a zone's name
    follows_target: bool = False  # rides on the end-effector's target, and holds the base alone
