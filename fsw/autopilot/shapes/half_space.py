"""Half-space ``n . p <= o``: a wall, a floor, a ceiling. To keep out is to stay in front of it.

Source: docs/equations.md E14, E22.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.geometry.vectors import dot
from fsw.autopilot.shapes.kind import Numbers, ShapeKind, Surface
from fsw.autopilot.signals import Shape, Vec3, Zone
from fsw.compiled import kernel


def half_space(normal: Vec3, offset: float) -> Shape:
    """What is behind the plane of a unit ``normal`` [1, NED] and ``offset`` [m] along it."""
    return Shape("half-space", (*normal, offset))


def wall(normal: Vec3, offset: float, clearance: float) -> Zone:
    """A wall to keep ``clearance`` [m] from; ``normal`` [1, NED] and ``offset`` [m] as above."""
    return Zone(half_space(normal, offset), clearance)


def _problem(numbers: tuple[float, ...]) -> str | None:
    length = math.hypot(*numbers[0:3])
    # Single precision leaves a unit normal within 1e-6; anything further off is another vector.
    if not abs(length - 1.0) < 1e-3:
        return f"the normal of a half-space has length {length:g}; 1 is needed"
    return None


@kernel
def _plane(
    numbers: NDArray[np.float64], keep_in: bool, which: int, x: float, y: float, z: float
) -> Surface:
    nx, ny, nz = numbers[0], numbers[1], numbers[2]
    distance = nx * x + ny * y + nz * z - numbers[3]
    return Surface(-distance, -nx, -ny, -nz) if keep_in else Surface(distance, nx, ny, nz)


def _moved(numbers: Numbers, shift: Vec3) -> Numbers:
    normal = (numbers[0], numbers[1], numbers[2])
    return (*normal, numbers[3] + dot(normal, shift))


def _covers(new: Zone, old: Zone) -> bool:
    """A parallel one that is no further out."""
    a, b, sign = new.shape.numbers, old.shape.numbers, -1.0 if new.keep_in else 1.0
    return a[:3] == b[:3] and sign * a[3] + new.clearance >= sign * b[3] + old.clearance


KIND = ShapeKind(
    name="half-space",
    number=0,
    meaning=("normal north", "normal east", "normal down", "offset [m]"),
    planes_inside=1,
    plane=_plane,
    problem=_problem,
    moved=_moved,
    covers=_covers,
    flat=True,
)
