"""A ball; of radius zero it is a point, such as the tip of a branch.

Source: docs/equations.md E11, E12, E23.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.shapes.kind import CENTRE_BALL, Numbers, ShapeKind, Surface, places
from fsw.autopilot.signals import Shape, Vec3, Zone
from fsw.compiled import kernel

PLANES_INSIDE = 6


def ball(centre: Vec3, radius: float) -> Shape:
    """A ball of ``radius`` [m] about ``centre`` [m, NED]."""
    return Shape("ball", (*centre, radius))


def point(position: Vec3, clearance: float) -> Zone:
    """A point at ``position`` [m, NED] to keep ``clearance`` [m] from."""
    return Zone(ball(position, 0.0), clearance)


def is_point(zone: Zone) -> bool:
    """Whether a zone is a ball of radius zero."""
    return zone.shape.kind == KIND.name and zone.shape.numbers[-1] == 0.0


def radius_problem(numbers: Numbers) -> str | None:
    """Why numbers that end with a radius [m] describe nothing round."""
    return None if numbers[-1] >= 0.0 else f"the radius is {numbers[-1]:g} m; it must not be < 0"


@kernel
def outward_axis(x: float, y: float, z: float, which: int) -> Vec3:
    """One of six unit vectors [1]: plus and minus an orthonormal frame, the first along (x, y, z).

    ``x``, ``y``, ``z`` [m, NED] lead from the centre to a point; at the centre the first axis is
    x. ``which`` [1] counts along the first axis, against it, along the second and so on.
    """
    length = math.sqrt(x * x + y * y + z * z)
    a = (1.0, 0.0, 0.0)
    if length > CENTRE_BALL:
        a = (x / length, y / length, z / length)
    sign = 1.0 if which % 2 == 0 else -1.0
    if which < 2:
        return sign * a[0], sign * a[1], sign * a[2]
    # The second axis starts from the world axis that is farthest from the first.
    along, bx, by, bz = a[0], 1.0, 0.0, 0.0
    if abs(a[1]) < abs(along):
        along, bx, by = a[1], 0.0, 1.0
    if abs(a[2]) < abs(along):
        along, bx, by, bz = a[2], 0.0, 0.0, 1.0
    scale = 1.0 / math.sqrt(1.0 - along * along)
    b = (scale * (bx - along * a[0]), scale * (by - along * a[1]), scale * (bz - along * a[2]))
    if which < 4:
        return sign * b[0], sign * b[1], sign * b[2]
    return (
        sign * (a[1] * b[2] - a[2] * b[1]),
        sign * (a[2] * b[0] - a[0] * b[2]),
        sign * (a[0] * b[1] - a[1] * b[0]),
    )


@kernel
def ball_plane(
    numbers: NDArray[np.float64], keep_in: bool, which: int, x: float, y: float, z: float
) -> Surface:
    """The tangent plane of a ball, ``numbers`` (16,) [m], near a point ``x``, ``y``, ``z`` [m].

    Inside, the planes touch the ball along plus and minus an orthonormal frame whose first axis is
    the outward ray; they contain the paper's pair h2a, h2b and nothing divides by the distance.
    Inside 2 mm of the centre any direction does.
    """
    x, y, z, radius = x - numbers[0], y - numbers[1], z - numbers[2], numbers[3]
    if keep_in:
        ax, ay, az = outward_axis(x, y, z, which)
        return Surface(radius - (ax * x + ay * y + az * z), -ax, -ay, -az)
    length = np.sqrt(x * x + y * y + z * z)
    nx, ny, nz = 1.0, 0.0, 0.0
    if length > CENTRE_BALL:
        nx, ny, nz = x / length, y / length, z / length
    return Surface(nx * x + ny * y + nz * z - radius, nx, ny, nz)


def covers_inside(new: Zone, old: Zone) -> bool:
    """A ball to stay in that lies in the other; to keep out, see ``ball_around``."""
    a, b = new.shape.numbers, old.shape.numbers
    apart = math.dist(a[:3], b[:3])
    return new.keep_in and apart + a[3] - new.clearance <= b[3] - old.clearance


def _ball_around(numbers: Numbers) -> tuple[Vec3, float]:
    x, y, z, radius = numbers
    return (x, y, z), radius


KIND = ShapeKind(
    name="ball",
    number=1,
    meaning=(*places("centre"), "radius [m]"),
    planes_inside=PLANES_INSIDE,
    plane=ball_plane,
    problem=radius_problem,
    covers=covers_inside,
    ball_around=_ball_around,
)
