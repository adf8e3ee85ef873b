"""An upright cylinder: a column, a person, a fence's circle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.shapes.cylinder import PLANES_INSIDE, cylinder_surface
from fsw.autopilot.shapes.kind import ENDLESS, Numbers, ShapeKind, Surface
from fsw.autopilot.signals import MAX_DISTANCE, Shape, Vec2, Vec3, Zone
from fsw.compiled import kernel


def vertical_cylinder(
    north_east: Vec2, radius: float, top: float = -ENDLESS, bottom: float = ENDLESS
) -> Shape:
    """An upright cylinder of ``radius`` [m] about ``north_east`` [m].

    From ``top`` [m, down] to ``bottom`` [m, down], by default without end.
    """
    return Shape("vertical cylinder", (*north_east, top, bottom, radius))


def column(north_east: Vec2, clearance: float) -> Zone:
    """An upright line at ``north_east`` [m] to keep ``clearance`` [m] from."""
    return Zone(vertical_cylinder(north_east, 0.0), clearance)


def _problem(numbers: tuple[float, ...]) -> str | None:
    if not numbers[3] > numbers[2]:
        return f"a cylinder from {numbers[2]:g} m down to {numbers[3]:g} m has no height"
    return None if numbers[4] >= 0.0 else f"the radius is {numbers[4]:g} m; it must not be < 0"


@kernel
def _plane(
    numbers: NDArray[np.float64], keep_in: bool, which: int, x: float, y: float, z: float
) -> Surface:
    middle = (numbers[0], numbers[1], 0.5 * (numbers[2] + numbers[3]))
    half = 0.5 * (numbers[3] - numbers[2])
    return cylinder_surface(middle, (0.0, 0.0, 1.0), half, numbers[4], keep_in, which, (x, y, z))


def _moved(numbers: Numbers, shift: Vec3) -> Numbers:
    north, east, top, bottom, radius = numbers
    return north + shift[0], east + shift[1], top + shift[2], bottom + shift[2], radius


def _covers(new: Zone, old: Zone) -> bool:
    """A thicker one that reaches as high and as low; to stay in, nothing is shown."""
    a, b = new.shape.numbers, old.shape.numbers
    apart = math.dist(a[:2], b[:2])
    high = a[2] <= max(b[2] - old.clearance, -MAX_DISTANCE)
    low = a[3] >= min(b[3] + old.clearance, MAX_DISTANCE)
    thick = apart + b[4] + old.clearance <= a[4] + new.clearance
    return not new.keep_in and high and low and thick


def _ball_around(numbers: Numbers) -> tuple[Vec3, float]:
    north, east, top, bottom, radius = numbers
    return (north, east, 0.5 * (top + bottom)), math.hypot(0.5 * (bottom - top), radius)


KIND = ShapeKind(
    name="vertical cylinder",
    number=3,
    meaning=("north [m]", "east [m]", "top, down [m]", "bottom, down [m]", "radius [m]"),
    planes_inside=PLANES_INSIDE,
    plane=_plane,
    problem=_problem,
    moved=_moved,
    covers=_covers,
    ball_around=_ball_around,
    endless=frozenset({2, 3}),
)
