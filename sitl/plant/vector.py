"""Three-vectors as tuples, of any unit: inside a compiled kernel they cost no allocation."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from sitl.compiled import compilable, kernel

Array: TypeAlias = npt.NDArray[np.float64]
V3: TypeAlias = tuple[float, float, float]
V4: TypeAlias = tuple[float, float, float, float]
V6: TypeAlias = tuple[float, float, float, float, float, float]
V8: TypeAlias = tuple[float, float, float, float, float, float, float, float]


# Entries are picked by index, not through slices: a slice of an array inside a kernel costs a
# reference count, and these run some hundred times per step.


@compilable
def triple(a: Array, i: int) -> V3:
    """Entries i, i+1, i+2 of a (n,) [any unit]."""
    return (a[i], a[i + 1], a[i + 2])


@kernel
def put(out: Array, i: int, v: V3) -> None:
    """Store v [any unit, any frame] in entries i, i+1, i+2 of out (n,) [same unit]."""
    out[i] = v[0]
    out[i + 1] = v[1]
    out[i + 2] = v[2]


@kernel
def row(a: Array, i: int) -> V3:
    """Row ``i`` of a (n, 3) [any unit]."""
    return (a[i, 0], a[i, 1], a[i, 2])


@compilable
def put_row(out: Array, i: int, v: V3) -> None:
    """Store v [any unit, any frame] in row ``i`` of out (n, 3) [same unit]."""
    out[i, 0] = v[0]
    out[i, 1] = v[1]
    out[i, 2] = v[2]


@kernel
def column(stack: Array, i: int, c: int) -> V3:
    """Column ``c`` of matrix ``i`` in a stack (n, 3, 3) [any unit]."""
    return (stack[i, 0, c], stack[i, 1, c], stack[i, 2, c])


@compilable
def times_one(stack: Array, i: int, v: V3) -> V3:
    """Product of matrix ``i`` in a stack (n, 3, 3) [any unit] and v [any unit, any frame]."""
    return (
        stack[i, 0, 0] * v[0] + stack[i, 0, 1] * v[1] + stack[i, 0, 2] * v[2],
        stack[i, 1, 0] * v[0] + stack[i, 1, 1] * v[1] + stack[i, 1, 2] * v[2],
        stack[i, 2, 0] * v[0] + stack[i, 2, 1] * v[1] + stack[i, 2, 2] * v[2],
    )


@kernel
def add(a: V3, b: V3) -> V3:
    """Sum of a [any unit, any frame] and b [same unit, same frame]."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def sub(a: V3, b: V3) -> V3:
    """Difference of a [any unit, any frame] and b [same unit, same frame]."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scale(s: float, a: V3) -> V3:
    """Product of s [any unit] and a [any unit, any frame]."""
    return (s * a[0], s * a[1], s * a[2])


@kernel
def dot(a: V3, b: V3) -> float:
    """Dot product of a [any unit, any frame] and b [any unit, same frame]."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: V3, b: V3) -> V3:
    """Cross product of a [any unit, any frame] and b [any unit, same frame]."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def times(m: Array, v: V3) -> V3:
    """Product of m (3, 3) [any unit] and v [any unit, any frame]."""
    return (
        m[0, 0] * v[0] + m[0, 1] * v[1] + m[0, 2] * v[2],
        m[1, 0] * v[0] + m[1, 1] * v[1] + m[1, 2] * v[2],
        m[2, 0] * v[0] + m[2, 1] * v[1] + m[2, 2] * v[2],
    )


@compilable
def transposed_times(m: Array, v: V3) -> V3:
    """Product of the transpose of m (3, 3) [any unit] and v [any unit, any frame]."""
    return (
        m[0, 0] * v[0] + m[1, 0] * v[1] + m[2, 0] * v[2],
        m[0, 1] * v[0] + m[1, 1] * v[1] + m[2, 1] * v[2],
        m[0, 2] * v[0] + m[1, 2] * v[1] + m[2, 2] * v[2],
    )


@compilable
def rotation_into(a: Array, i: int, out: Array) -> None:
    """R_WB into out (3, 3) [1] from the quaternion w, x, y, z in entries i … i+3 of a (n,) [1].

    Of any length: dividing by its square keeps the derivative smooth at Runge–Kutta stages, where
    the length is off one by O(dt²).
    """
    w, x, y, z = a[i], a[i + 1], a[i + 2], a[i + 3]
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
