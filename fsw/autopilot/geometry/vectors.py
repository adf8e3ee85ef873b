"""Vector arithmetic on tuples of floats, for plain and compiled code alike.

At three entries NumPy costs more than it saves
(docs/decisions/0003-plain-floats-in-the-fast-loop.md). The order of the operations is part of the
contract: a recorded flight replays to the last bit.
"""

from __future__ import annotations

import math
from typing import Any, Final

from numpy.typing import NDArray

from fsw.autopilot.signals import Vec3, Vec4
from fsw.compiled import compilable

Vector = Vec3 | NDArray[Any]  # compiled code may hand over a row of an array (3,)
ZERO: Final[Vec3] = (0.0, 0.0, 0.0)
Several = tuple[float, ...] | NDArray[Any]  # vectors one after the other


@compilable
def three(a: Several, at: int) -> Vec3:
    """The vector in ``a`` (n,) [any unit, any frame] that begins ``at`` [1]."""
    return a[at], a[at + 1], a[at + 2]


@compilable
def put_three(a: NDArray[Any], at: int, v: Vec3) -> None:
    """Write ``v`` [unit of a, any frame] into ``a`` (n,) [any unit] from ``at`` [1] on."""
    a[at], a[at + 1], a[at + 2] = v


@compilable
def four(a: Several, at: int = 0) -> Vec4:
    """Four entries of ``a`` (n,) [any unit], a quaternion as a rule, from ``at`` [1] on."""
    return a[at], a[at + 1], a[at + 2], a[at + 3]


@compilable
def put_four(a: NDArray[Any], q: Vec4) -> None:
    """Write ``q`` [any unit] into ``a`` (4,) [unit of q]."""
    a[0], a[1], a[2], a[3] = q


@compilable
def dot(a: Vector, b: Vector) -> float:
    """Inner product of ``a`` [any unit, any frame] and ``b`` [any unit, the same frame]."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compilable
def add_scaled(a: Vector, b: Vector, scale: float) -> Vec3:
    """``a`` [any unit, any frame] plus ``scale`` [a / b] times ``b`` [any unit, same frame]."""
    return a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]


@compilable
def add(a: Vector, b: Vector) -> Vec3:
    """``a`` [any unit, any frame] plus ``b`` [unit of a, the same frame]."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compilable
def subtract(a: Vector, b: Vector) -> Vec3:
    """``a`` [any unit, any frame] minus ``b`` [unit of a, the same frame]."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compilable
def cross(a: Vector, b: Vector) -> Vec3:
    """``a`` [any unit, any frame] cross ``b`` [any unit, the same frame]."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compilable
def norm(a: Vec3) -> float:
    """Euclidean length of ``a`` [any unit, any frame]."""
    return math.sqrt(dot(a, a))


@compilable
def clamp(value: float, low: float, high: float) -> float:
    """``value`` [any unit] limited to ``low`` [same unit] and ``high`` [same unit]."""
    return min(max(value, low), high)


@compilable
def clamp_magnitude(value: float, bound: float) -> float:
    """``value`` [any unit] limited to ± ``bound`` [same unit]."""
    return min(max(value, -bound), bound)


@compilable
def limit_norm(a: Vec3, most: float) -> Vec3:
    """``a`` [any unit, any frame], shortened to length ``most`` [unit of a] if it is longer."""
    length = norm(a)
    return a if length <= most else add_scaled((0.0, 0.0, 0.0), a, most / length)
