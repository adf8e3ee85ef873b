"""Directions all round a point, for shapes that hold it inside."""

from __future__ import annotations

import math

from fsw.autopilot.signals import Vec3
from fsw.compiled import kernel

CENTRE_BALL = 0.002  # m; closer to a centre than this a direction is noise and any does


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
