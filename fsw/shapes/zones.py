"""A safe set as arrays, where its zones are at a time, and how far a point is from each."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import literal_unroll
from numpy.typing import NDArray

from fsw.compiled import kernel, of_fixed_types
from fsw.shapes import BY_NAME, KINDS
from fsw.shapes.kind import NUMBERS, Surface
from fsw.signals import EndEffectorTarget, SafeSet, Vec3

Array = NDArray[np.float64]

_PLANES = tuple(kind.plane for kind in KINDS)
_INDEX = {kind.name: k for k, kind in enumerate(KINDS)}


# Columns of a zone's row; one array, because compiled code counts the references to each.
KIND, KEEP_IN, CLEARANCE, PLANES, FLAT, FOLLOWS, FIRST = range(7)
"""Which of KINDS; whether to keep in; clearance [m]; how many planes each place has; whether they
are the same everywhere; whether it rides on the target and keeps the base alone; its numbers."""


@lru_cache(maxsize=16)
def zone_arrays(safe_set: SafeSet) -> Array:
    """A safe set as rows of numbers (zones, FIRST + 16), for kernels."""
    rows = np.zeros((len(safe_set.zones), FIRST + NUMBERS))
    for row, zone in zip(rows, safe_set.zones, strict=True):
        kind = BY_NAME[zone.shape.kind]
        row[KIND], row[KEEP_IN], row[CLEARANCE] = _INDEX[kind.name], zone.keep_in, zone.clearance
        row[PLANES] = kind.planes_inside if zone.keep_in else 1
        row[FLAT], row[FOLLOWS] = kind.flat, kind.follows_target
        row[FIRST : FIRST + kind.size] = zone.shape.numbers
    return rows


@kernel
def surface_at(zones: Array, zone: int, which: int, x: float, y: float, z: float) -> Surface:
    """Distance [m] from a ``zone`` [1] with its clearance to a point, and the normal [1].

    ``zones`` (zones, FIRST + 16) [SI] are all of them; ``x``, ``y``, ``z`` [m, NED] are seen from
    where the zone is: its movement is taken off. ``which`` [1] of its planes is asked for.
    """
    kind, keep_in, numbers = zones[zone, KIND], zones[zone, KEEP_IN] > 0.0, zones[zone, FIRST:]
    at = Surface(0.0, 0.0, 0.0, 0.0)
    k = 0
    for plane in literal_unroll(_PLANES):
        if k == kind:
            at = plane(numbers, keep_in, which, x, y, z)
        k += 1  # noqa: SIM113 - numba unrolls no enumerate
    return Surface(at.distance - zones[zone, CLEARANCE], at.nx, at.ny, at.nz)


def shifts(
    safe_set: SafeSet, times_us: NDArray[np.int64], p_target: Array, v_target: Array
) -> tuple[Array, Array]:
    """How far each zone has moved at each time, and its velocity, (times, zones, 3) [m], [m/s].

    ``p_target`` (times, 3) [m, NED] and ``v_target`` (times, 3) [m/s, NED] are those of the target.
    """
    zones = safe_set.zones
    velocity = np.array([zone.velocity for zone in zones]).reshape(-1, 3)
    begin_us = np.array([zone.t_us for zone in zones], dtype=np.int64)
    elapsed = 1e-6 * (times_us[:, None] - begin_us)
    moved = elapsed[:, :, None] * velocity
    velocities = np.broadcast_to(velocity, moved.shape).copy()
    for k, zone in enumerate(zones):
        if BY_NAME[zone.shape.kind].follows_target:
            moved[:, k], velocities[:, k] = p_target, v_target
    return moved, velocities


_surface_at = of_fixed_types(surface_at)


def surfaces(
    safe_set: SafeSet, p: Vec3, t_us: int, target: EndEffectorTarget | None = None
) -> tuple[Surface, ...]:
    """The plane of each zone near ``p`` [m, NED] at a time, with its clearance taken off.

    Of a zone to keep in, the nearest one. A zone that follows the target is left out without one.
    """
    found = (surface(safe_set, k, p, t_us, target) for k in range(len(safe_set.zones)))
    return tuple(at for at in found if at is not None)


def surface(
    safe_set: SafeSet, zone: int, p: Vec3, t_us: int, target: EndEffectorTarget | None = None
) -> Surface | None:
    """``surfaces`` of one zone, by its number; None where that leaves it out; ``p`` [m, NED]."""
    shift = shift_of(safe_set, zone, t_us, target)
    if shift is None:
        return None
    return min(_planes(zone_arrays(safe_set), zone, p, shift), key=lambda at: at.distance)


def all_planes(safe_set: SafeSet, p: Vec3, t_us: int) -> list[tuple[int, Surface]]:
    """Every plane of each zone near ``p`` [m, NED] at a time, with the zone's number.

    Of a zone to keep in there are several. Zones that follow the target are left out.
    """
    arrays, found = zone_arrays(safe_set), []
    for zone in range(len(safe_set.zones)):
        shift = shift_of(safe_set, zone, t_us, None)
        if shift is not None:
            found += [(zone, at) for at in _planes(arrays, zone, p, shift)]
    return found


def _planes(arrays: Array, zone: int, p: Vec3, shift: Vec3) -> list[Surface]:
    x, y, z = p[0] - shift[0], p[1] - shift[1], p[2] - shift[2]
    which = range(int(arrays[zone, PLANES]))
    return [Surface(*_surface_at(arrays, zone, one, x, y, z)) for one in which]


def shift_of(
    safe_set: SafeSet, zone: int, t_us: int, target: EndEffectorTarget | None
) -> Vec3 | None:
    """How far a zone has moved at a time [m, NED]; None: it follows a target and there is none."""
    one = safe_set.zones[zone]
    if BY_NAME[one.shape.kind].follows_target:
        return None if target is None else target.p_WE
    if one.velocity == (0.0, 0.0, 0.0):
        return one.velocity
    elapsed = 1e-6 * (t_us - one.t_us)
    vx, vy, vz = one.velocity
    return elapsed * vx, elapsed * vy, elapsed * vz
