"""A box in any attitude: a shelf, a beam, a room from inside."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.shapes.kind import Numbers, ShapeKind, Surface, places
from fsw.autopilot.signals import Shape, Vec3, Vec4, Zone
from fsw.compiled import kernel


def box(centre: Vec3, half_size: Vec3, attitude: Vec4 = (1.0, 0.0, 0.0, 0.0)) -> Shape:
    """A box about ``centre`` [m, NED], of ``half_size`` [m, its own axes].

    ``attitude`` [1] is the unit quaternion (w, x, y, z) from its axes to NED.
    """
    return Shape("box", (*centre, *half_size, *attitude))


def _problem(numbers: tuple[float, ...]) -> str | None:
    if not min(numbers[3:6]) > 0.0:
        return f"a box has half size {min(numbers[3:6]):g} m; > 0 is needed"
    length = math.hypot(*numbers[6:10])
    if not abs(length - 1.0) < 1e-3:
        return f"the attitude of a box is a quaternion of length {length:g}; 1 is needed"
    return None


@kernel
def _axis(numbers: NDArray[np.float64], k: int) -> Vec3:
    """One of the box's axes in NED, a column of the rotation matrix."""
    w, x, y, z = numbers[6], numbers[7], numbers[8], numbers[9]
    if k == 0:
        return 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    if k == 1:
        return 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)


@kernel
def _plane(
    numbers: NDArray[np.float64], keep_in: bool, which: int, x: float, y: float, z: float
) -> Surface:
    x, y, z = x - numbers[0], y - numbers[1], z - numbers[2]
    nearest, deepest = 0, -math.inf
    nx, ny, nz, square = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        ax, ay, az = _axis(numbers, k)
        along = ax * x + ay * y + az * z
        beyond = abs(along) - numbers[3 + k]
        if beyond > deepest:
            nearest, deepest = k, beyond
        if beyond > 0.0:
            step = beyond if along > 0.0 else -beyond
            nx, ny, nz = nx + step * ax, ny + step * ay, nz + step * az
            square += beyond * beyond
    if square > 0.0 and not keep_in:
        away = math.sqrt(square)
        return Surface(away, nx / away, ny / away, nz / away)
    face = which // 2 if keep_in else nearest
    ax, ay, az = _axis(numbers, face)
    along = ax * x + ay * y + az * z
    if keep_in:
        sign = 1.0 if which % 2 == 0 else -1.0
        return Surface(numbers[3 + face] - sign * along, -sign * ax, -sign * ay, -sign * az)
    sign = 1.0 if along >= 0.0 else -1.0
    return Surface(deepest, sign * ax, sign * ay, sign * az)


def _covers(new: Zone, old: Zone) -> bool:
    """One of the same place and attitude that is no smaller, or to stay in no larger."""
    a, b = new.shape.numbers, old.shape.numbers
    if new.clearance < old.clearance or (a[:3], a[6:]) != (b[:3], b[6:]):
        return False
    sizes = zip(a[3:6], b[3:6], strict=True)
    return all(x <= y if new.keep_in else x >= y for x, y in sizes)


def _ball_around(numbers: Numbers) -> tuple[Vec3, float]:
    x, y, z, *half_size = numbers[:6]
    return (x, y, z), math.hypot(*half_size)


KIND = ShapeKind(
    name="box",
    number=5,
    meaning=(
        *places("centre"),
        *(f"half size along its {axis} [m]" for axis in "xyz"),
        *(f"attitude {entry}" for entry in "wxyz"),
    ),
    planes_inside=6,
    plane=_plane,
    problem=_problem,
    covers=_covers,
    ball_around=_ball_around,
)
