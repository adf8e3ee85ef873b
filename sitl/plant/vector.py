"""Three-vectors as tuples: inside a compiled kernel they cost no allocation."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from sitl.compiled import compiled

Array: TypeAlias = npt.NDArray[np.float64]
V3: TypeAlias = tuple[float, float, float]


@compiled
def row(a: Array) -> V3:
    """The three numbers of a (3,) array."""
    return (a[0], a[1], a[2])


@compiled
def put(out: Array, v: V3) -> None:
    """Store ``v`` in a (3,) array."""
    out[0] = v[0]
    out[1] = v[1]
    out[2] = v[2]


@compiled
def add(a: V3, b: V3) -> V3:
    """A + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@compiled
def sub(a: V3, b: V3) -> V3:
    """A - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@compiled
def scale(s: float, a: V3) -> V3:
    """S a."""
    return (s * a[0], s * a[1], s * a[2])


@compiled
def dot(a: V3, b: V3) -> float:
    """A · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: V3, b: V3) -> V3:
    """A × b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def times(m: Array, v: V3) -> V3:
    """M v for a (3, 3) array."""
    return (
        m[0, 0] * v[0] + m[0, 1] * v[1] + m[0, 2] * v[2],
        m[1, 0] * v[0] + m[1, 1] * v[1] + m[1, 2] * v[2],
        m[2, 0] * v[0] + m[2, 1] * v[1] + m[2, 2] * v[2],
    )


@compiled
def transposed_times(m: Array, v: V3) -> V3:
    """Mᵀ v for a (3, 3) array."""
    return (
        m[0, 0] * v[0] + m[1, 0] * v[1] + m[2, 0] * v[2],
        m[0, 1] * v[0] + m[1, 1] * v[1] + m[2, 1] * v[2],
        m[0, 2] * v[0] + m[1, 2] * v[1] + m[2, 2] * v[2],
    )


@compiled
def rotation_into(w: float, x: float, y: float, z: float, out: Array) -> None:
    """R_WB (3, 3) of the quaternion [w, x, y, z], which need not be of unit length.

    Dividing by the squared length keeps the derivative smooth at Runge–Kutta stages, where
    the length is off one by O(dt²).
    """
    s = 2.0 / (w * w + x * x + y * y + z * z)
    out[0, 0] = 1.0 - s * (y * y + z * z)
    out[0, 1] = s * (x * y - w * z)
    out[0, 2] = s * (x * z + w * y)
    out[1, 0] = s * (x * y + w * z)
    out[1, 1] = 1.0 - s * (x * x + z * z)
    out[1, 2] = s * (y * z - w * x)
    out[2, 0] = s * (x * z - w * y)
    out[2, 1] = s * (y * z + w * x)
    out[2, 2] = 1.0 - s * (x * x + y * y)
