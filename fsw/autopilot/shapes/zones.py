"""A safe set as arrays, where its zones are at a time, and how far a point is from each."""

from __future__ import annotations

import numpy as np
from numba import literal_unroll
from numpy.typing import NDArray

from fsw.autopilot.geometry.vectors import add_scaled
from fsw.autopilot.shapes import BY_NAME, KINDS
from fsw.autopilot.shapes.kind import NUMBERS, Surface
from fsw.autopilot.signals import EndEffectorTarget, SafeSet, Vec3
from fsw.compiled import compilable, kernel, machine_code
from fsw.frozen import Remembered

Array = NDArray[np.float64]
Zones = Array
"""A row a zone (zones, columns) [SI]: as of ``zone_arrays``, or of ``moving_zones``, which move."""

_PLANES = tuple(kind.plane for kind in KINDS)
_INDEX = {kind.name: k for k, kind in enumerate(KINDS)}


# Columns of a zone's row; one array, because compiled code counts the references to each.
KIND, KEEP_IN, CLEARANCE, PLANES, FLAT, FOLLOWS = range(6)
FORCE_MAX, STIFF, DAMPS, ROUGH, FIRST = range(6, 11)
"""Which of KINDS; whether to keep in; clearance [m]; how many planes each place has; whether they
are the same everywhere; whether it rides on the target and keeps the base alone; the force [N] with
which the tool may press on it, 0: none, and the largest stiffness [N/m], the dissipation [s/m] and
the friction that it then meets; its numbers."""
_MOVE = FIRST + NUMBERS  # behind them its velocity, where it is at a time, that time
_ACCELERATION = _MOVE + 7  # m/s^2, of a target: within 0.1 s its turning moves it by millimetres
ADDED = _ACCELERATION + 3  # m, in its clearance for an uncertain estimate
_COLUMNS = ADDED + 1

NO_ZONES: Array = np.zeros((0, _COLUMNS))


@Remembered
def zone_arrays(safe_set: SafeSet) -> Array:
    """A safe set as rows of numbers (zones, FIRST + 16), for kernels."""
    rows = np.zeros((len(safe_set.zones), FIRST + NUMBERS))
    for row, zone in zip(rows, safe_set.zones, strict=True):
        kind = BY_NAME[zone.shape.kind]
        row[KIND], row[KEEP_IN], row[CLEARANCE] = _INDEX[kind.name], zone.keep_in, zone.clearance
        row[PLANES] = kind.planes_inside if zone.keep_in else 1
        row[FLAT], row[FOLLOWS] = kind.flat, kind.follows_target
        row[FIRST : FIRST + kind.size] = zone.shape.numbers
        if zone.touch is not None:
            row[FORCE_MAX], row[STIFF] = zone.touch.force_max, zone.touch.stiffness_high
            row[DAMPS], row[ROUGH] = zone.touch.dissipation, zone.touch.friction
    return rows


@kernel
def surface_at(zones: Zones, zone: int, which: int, x: float, y: float, z: float) -> Surface:
    """Distance [m] from a ``zone`` [1] with its clearance to a point, and the normal [1].

    ``x``, ``y``, ``z`` [m, NED] are seen from where the zone is: its movement is taken off.
    ``which`` of its planes is asked for.
    """
    kind, keep_in, numbers = zones[zone, KIND], zones[zone, KEEP_IN] > 0.0, zones[zone, FIRST:]
    at = Surface(0.0, 0.0, 0.0, 0.0)
    k = 0
    for plane in literal_unroll(_PLANES):
        if k == kind:
            at = plane(numbers, keep_in, which, x, y, z)
        k += 1  # noqa: SIM113 - numba unrolls no enumerate
    return Surface(at.distance - zones[zone, CLEARANCE], at.nx, at.ny, at.nz)


def moving_zones(
    safe_set: SafeSet, target: EndEffectorTarget | None, added: tuple[float, ...] = ()
) -> Array:
    """The zones and how they move, (zones, columns) [SI]; of no target, without what follows it.

    ``added`` [m] of each zone's clearance is for an uncertain estimate, and no margin.
    """
    if not safe_set.zones:
        return NO_ZONES
    rows = np.zeros((len(safe_set.zones), _COLUMNS))
    rows[:, :_MOVE] = zone_arrays(safe_set)
    if added:
        rows[:, ADDED] = added
    for row, zone in zip(rows, safe_set.zones, strict=True):
        row[_MOVE : _MOVE + 3], row[_MOVE + 6] = zone.velocity, zone.t_us
        if row[FOLLOWS] > 0.0 and target is not None:
            row[_MOVE : _MOVE + 3], row[_MOVE + 3 : _MOVE + 6] = target.v_WE, target.p_WE
            row[_MOVE + 6], row[_ACCELERATION : _ACCELERATION + 3] = target.t_us, target.a_WE
    return rows if target is not None else rows[rows[:, FOLLOWS] == 0.0]


@compilable
def acceleration_of(zones: Zones, zone: int) -> Vec3:
    """Acceleration [m/s^2, NED] of one of ``moving_zones``."""
    k = _ACCELERATION
    return zones[zone, k], zones[zone, k + 1], zones[zone, k + 2]


@compilable
def velocity_of(zones: Zones, zone: int, t_us: int) -> Vec3:
    """Velocity [m/s, NED] of one of ``moving_zones``."""
    v = zones[zone, _MOVE], zones[zone, _MOVE + 1], zones[zone, _MOVE + 2]
    return add_scaled(v, acceleration_of(zones, zone), 1e-6 * (t_us - zones[zone, _MOVE + 6]))


@compilable
def moved_by(zones: Zones, zone: int, t_us: int) -> Vec3:
    """How far one of ``moving_zones`` has moved at a time [m, NED]."""
    elapsed = 1e-6 * (t_us - zones[zone, _MOVE + 6])
    v = zones[zone, _MOVE], zones[zone, _MOVE + 1], zones[zone, _MOVE + 2]
    mean = add_scaled(v, acceleration_of(zones, zone), 0.5 * elapsed)
    p = zones[zone, _MOVE + 3], zones[zone, _MOVE + 4], zones[zone, _MOVE + 5]
    return add_scaled(p, mean, elapsed)


@compilable
def nearest_plane(zones: Zones, zone: int, p: Vec3, t_us: int) -> Surface:
    """The plane of a zone that is nearest to ``p`` [m, NED] at a time, its clearance taken off."""
    shift = moved_by(zones, zone, t_us)
    x, y, z = p[0] - shift[0], p[1] - shift[1], p[2] - shift[2]
    nearest = surface_at(zones, zone, 0, x, y, z)
    for which in range(1, int(zones[zone, PLANES])):
        at = surface_at(zones, zone, which, x, y, z)
        if at.distance < nearest.distance:
            nearest = at
    return nearest


def all_moving_zones(safe_set: SafeSet) -> Array:
    """Those of ``moving_zones``, with the zones that follow the target, wherever it is."""
    return moving_zones(safe_set, _NO_TARGET)


def shifts(
    zones: Zones, times_us: NDArray[np.int64], p_target: Array, v_target: Array
) -> tuple[Array, Array]:
    """How far each zone has moved at each time, and its velocity, (times, zones, 3) [m], [m/s].

    Of ``all_moving_zones``; the target has ``p_target`` (times, 3) [m, NED] and ``v_target``
    (times, 3) [m/s, NED].
    """
    moved = np.empty((len(times_us), len(zones), 3))
    velocities = np.empty_like(moved)
    _fill_shifts(zones, times_us, p_target, v_target, moved, velocities)
    return moved, velocities


@kernel
def _shifts(
    zones: Zones,
    times_us: NDArray[np.int64],
    p_target: Array,
    v_target: Array,
    moved: Array,
    velocities: Array,
) -> None:
    for i in range(len(times_us)):
        for k in range(len(zones)):
            follows = zones[k, FOLLOWS] > 0.0
            shift, velocity = moved_by(zones, k, times_us[i]), velocity_of(zones, k, times_us[i])
            for axis in range(3):
                moved[i, k, axis] = p_target[i, axis] if follows else shift[axis]
                velocities[i, k, axis] = v_target[i, axis] if follows else velocity[axis]


_surface_at, _fill_shifts = machine_code(surface_at), machine_code(_shifts)
_REST: Vec3 = (0.0, 0.0, 0.0)
_NO_TARGET = EndEffectorTarget(0, _REST, _REST, _REST)


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
