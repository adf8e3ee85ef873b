"""What a file of this folder must provide to be a shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.signals import MAX_DISTANCE, Shape, Vec3, Zone

NUMBERS = 16  # most numbers that describe a shape
ENDLESS = 1e4  # m; what has no end ends here
CENTRE_BALL = 0.002  # m; closer to a centre than this a direction is noise and any does


class Surface(NamedTuple):
    """The plane that stands for a shape near one point."""

    distance: float  # m, of the point, positive on the free side
    nx: float  # unit normal into the free side, NED
    ny: float
    nz: float

    @property
    def normal(self) -> Vec3:
        """Unit normal into the free side, NED."""
        return self.nx, self.ny, self.nz


Numbers = tuple[float, ...]


def places(*what: str) -> tuple[str, ...]:
    """The meaning of the three numbers of each place, NED."""
    return tuple(f"{one} {axis} [m]" for one in what for axis in ("north", "east", "down"))


def place_moved(numbers: Numbers, shift: Vec3) -> Numbers:
    """``numbers`` [SI] that begin with a shape's place [m, NED], moved by ``shift`` [m, NED]."""
    x, y, z, *rest = numbers
    return (x + shift[0], y + shift[1], z + shift[2], *rest)


PlaneOf = Callable[[NDArray[np.float64], bool, int, float, float, float], Surface]
"""From (numbers, keep_in, which, x, y, z [m, NED]) to the plane; see ``ShapeKind.plane``."""


@dataclass(frozen=True, slots=True)
class ShapeKind:
    """One kind of shape.

    To keep a point out of a convex shape one plane is enough, the one that touches it where it is
    nearest. To keep a point inside, planes all round are needed: ``planes_inside``.
    """

    name: str  # as in scenarios and texts
    number: int  # PANDION_SHAPE of the dialect
    meaning: tuple[str, ...]  # of each of its numbers, with the unit
    planes_inside: int
    plane: PlaneOf  # compiled; the free side is outside, or inside where ``keep_in``
    problem: Callable[[Numbers], str | None]  # why numbers describe no such shape
    moved: Callable[[Numbers, Vec3], Numbers] = place_moved  # the numbers of the shape elsewhere
    # Whether every place that the first of two zones leaves free the second does too. Both are of
    # this kind, kept out of or both in, clearances included; False where it is not shown.
    covers: Callable[[Zone, Zone], bool] = lambda _new, _old: False
    # Centre [m, NED] and radius [m] of a ball that holds the shape of these numbers, if any does.
    ball_around: Callable[[Numbers], tuple[Vec3, float] | None] = lambda _numbers: None
    flat: bool = False  # its plane is the same wherever the point is
    follows_target: bool = False  # rides on the end-effector's target, and keeps the base alone
    endless: frozenset[int] = frozenset()  # which of its numbers may be ENDLESS

    @property
    def size(self) -> int:
        """How many numbers describe it."""
        return len(self.meaning)

    @property
    def farthest(self) -> tuple[float, ...]:
        """The largest magnitude of each of its numbers that is believed [the number's unit]."""
        return tuple(ENDLESS if k in self.endless else MAX_DISTANCE for k in range(self.size))

    def check(self, shape: Shape) -> str | None:
        """Why this is not a shape of this kind, in a sentence; None if it is one."""
        if len(shape.numbers) != self.size:
            return f"a {self.name} has {self.size} numbers, not {len(shape.numbers)}"
        if not np.isfinite(shape.numbers).all():
            return f"a {self.name} has a number that is not finite"
        return self.problem(shape.numbers)
