"""A cylinder in any direction, with flat ends: a pipe, a beam, a trunk that leans."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.shapes.kind import CENTRE_BALL, Numbers, ShapeKind, Surface, place_moved, places
from fsw.autopilot.signals import Shape, Vec3, Zone
from fsw.compiled import kernel

PLANES_INSIDE = 6
_SHORTEST = 1e-3  # m


def cylinder(begin: Vec3, end: Vec3, radius: float) -> Shape:
    """A cylinder of ``radius`` [m] about the line from ``begin`` [m, NED] to ``end`` [m, NED]."""
    return Shape("cylinder", (*begin, *end, radius))


def _problem(numbers: tuple[float, ...]) -> str | None:
    length = math.dist(numbers[0:3], numbers[3:6])
    if not length >= _SHORTEST:
        return f"a cylinder has length {length:g} m; at least {_SHORTEST:g} m is needed"
    return None if numbers[6] > 0.0 else f"a cylinder has radius {numbers[6]:g} m; > 0 is needed"


@kernel
def cylinder_surface(
    middle: Vec3,
    axis: Vec3,
    half_length: float,
    radius: float,
    keep_in: bool,
    which: int,
    p: Vec3,
) -> Surface:
    """The plane of a cylinder about ``middle`` [m, NED] along the unit ``axis`` [1, NED].

    ``half_length`` [m] and ``radius`` [m] are its size, ``p`` [m, NED] the point. Outside, it
    touches where the cylinder is nearest, at a rim too. Inside, the planes are two and two along
    and across the ray from the axis, and the two ends.
    """
    x, y, z = p[0] - middle[0], p[1] - middle[1], p[2] - middle[2]
    along = x * axis[0] + y * axis[1] + z * axis[2]
    rx, ry, rz = x - along * axis[0], y - along * axis[1], z - along * axis[2]
    distance = math.sqrt(rx * rx + ry * ry + rz * rz)
    if distance > CENTRE_BALL:
        rx, ry, rz = rx / distance, ry / distance, rz / distance
    else:  # any direction across the axis; the one from the axis of the world farthest from it
        if abs(axis[0]) < 0.6:
            rx, ry, rz = 1.0 - axis[0] * axis[0], -axis[0] * axis[1], -axis[0] * axis[2]
        else:
            rx, ry, rz = -axis[1] * axis[0], 1.0 - axis[1] * axis[1], -axis[1] * axis[2]
        length = math.sqrt(rx * rx + ry * ry + rz * rz)
        rx, ry, rz = rx / length, ry / length, rz / length
        distance = 0.0
    if keep_in:
        sign = 1.0 if which % 2 == 0 else -1.0
        if which >= 4:
            return Surface(
                half_length - sign * along, -sign * axis[0], -sign * axis[1], -sign * axis[2]
            )
        if which < 2:
            return Surface(radius - sign * distance, -sign * rx, -sign * ry, -sign * rz)
        return Surface(
            radius,
            -sign * (axis[1] * rz - axis[2] * ry),
            -sign * (axis[2] * rx - axis[0] * rz),
            -sign * (axis[0] * ry - axis[1] * rx),
        )
    end = 1.0 if along >= 0.0 else -1.0
    aside, beyond = distance - radius, abs(along) - half_length
    if aside > 0.0 and beyond > 0.0:
        away = math.sqrt(aside * aside + beyond * beyond)
        a, b = aside / away, end * beyond / away
        return Surface(away, a * rx + b * axis[0], a * ry + b * axis[1], a * rz + b * axis[2])
    if aside >= beyond:
        return Surface(aside, rx, ry, rz)
    return Surface(beyond, end * axis[0], end * axis[1], end * axis[2])


@kernel
def _plane(
    numbers: NDArray[np.float64], keep_in: bool, which: int, x: float, y: float, z: float
) -> Surface:
    ax, ay, az = numbers[3] - numbers[0], numbers[4] - numbers[1], numbers[5] - numbers[2]
    length = math.sqrt(ax * ax + ay * ay + az * az)
    axis = (ax / length, ay / length, az / length)
    middle = (numbers[0] + 0.5 * ax, numbers[1] + 0.5 * ay, numbers[2] + 0.5 * az)
    return cylinder_surface(middle, axis, 0.5 * length, numbers[6], keep_in, which, (x, y, z))


def _moved(numbers: Numbers, shift: Vec3) -> Numbers:
    end = place_moved(numbers[3:], shift)
    return (*place_moved(numbers[:3], shift), *end)


def _covers(new: Zone, old: Zone) -> bool:
    """One about the same line that is no thinner, or to stay in no thicker."""
    a, b = new.shape.numbers, old.shape.numbers
    if new.clearance < old.clearance or a[:6] != b[:6]:
        return False
    return a[6] <= b[6] if new.keep_in else a[6] >= b[6]


def _ball_around(numbers: Numbers) -> tuple[Vec3, float]:
    n = numbers
    middle = (0.5 * (n[0] + n[3]), 0.5 * (n[1] + n[4]), 0.5 * (n[2] + n[5]))
    return middle, math.hypot(0.5 * math.dist(n[:3], n[3:6]), n[6])


KIND = ShapeKind(
    name="cylinder",
    number=4,
    meaning=(*places("begin", "end"), "radius [m]"),
    planes_inside=PLANES_INSIDE,
    plane=_plane,
    problem=_problem,
    moved=_moved,
    covers=_covers,
    ball_around=_ball_around,
)
