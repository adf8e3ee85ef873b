"""Zones and ground, judged on the plant's true state.

Source: docs/equations.md E11, E14, E15.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sitl.body import BALL, SHAFT, TIP, Parts, as_arrays, parts_of, spoken
from sitl.compiled import compilable, kernel
from sitl.distance import part_bound, part_distance
from sitl.nearest import nearest
from sitl.plant.vector import V3, Array, dot, put_row, row, sub
from sitl.scenario import Scenario, vehicle_of
from sitl.shapes import KINDS
from sitl.shapes.kind import NUMBERS
from sitl.trajectory import place_on_curve
from sitl.zones import Zone, zones_of

_NOWHERE = (math.nan, math.nan, math.nan)
_ROUNDING = 1e-5  # m; distances are searched to 1e-6
_WORTH = 0.01  # m; where a bound leaves less to travel, the distance itself is worked out
_FAR = 1e9  # m


class ZoneTable(NamedTuple):
    """The zones as arrays for kernels."""

    kind: npt.NDArray[np.int64]  # (zones,) which of KINDS
    numbers: Array  # (zones, 16), where each zone begins
    keep_in: npt.NDArray[np.bool_]  # (zones,)
    clearance: Array  # (zones,) m
    touch: npt.NDArray[np.bool_]  # (zones,) the tool may touch it
    follows: npt.NDArray[np.bool_]  # (zones,) rides on the target and holds the base's origin alone
    legs: Array  # (legs, 7): begin [s], moved until then [m, NED], velocity from then on [m/s, NED]
    first_leg: npt.NDArray[np.int64]  # (zones + 1,)


class World:
    """The surroundings of one scenario, and what of the vehicle is kept clear of them."""

    def __init__(self, scenario: Scenario) -> None:
        self.zones, vehicle = zones_of(scenario), vehicle_of(scenario)
        parts = parts_of(scenario.body, vehicle)
        self.table, self.parts = zone_table(self.zones), as_arrays(parts, vehicle)
        self.follows = bool(self.table.follows.any())
        kept = [
            (zone, part)
            for zone in self.zones
            for part in (parts[:1] if zone.kind.follows_target else parts)
            if zone.table.touch is None or part.tool != TIP
        ]
        self.keys = tuple(f"{zone.table.name}/{part.name}" for zone, part in kept)
        self._kept = [(zone, part.name) for zone, part in kept]
        self._points = [one.name for one in vehicle.critical_points]
        self.clearances = np.array(
            [
                0.0 if zone.table.touch and part.tool == SHAFT else zone.table.clearance_m
                for zone, part in kept
            ]
        )

    def margins(self, places: Array, time_s: float, target: V3 | None) -> tuple[float, ...]:
        """Margins [m] as ``keys``, of places (rows, 3) [m, NED]; negative means violated.

        Without ``target`` [m, NED], the end-effector's reference, a zone that rides on it does not
        apply: its margin is infinite.
        """
        out = np.empty(len(self.keys))
        fill_margins(self.table, self.parts, places, time_s, target or _NOWHERE, out)
        if target is None:
            out[np.isnan(out) & np.isfinite(places[:1]).all()] = math.inf
        return tuple(out.tolist())

    def collision(self, places: Array, margins: tuple[float, ...]) -> str | None:
        """A sentence if a part with these margins touches a zone or the ground, else None.

        The ground is touched by the critical points of places (rows, 3) [m, NED]. To leave a zone
        that is to be kept in is a violation, not a collision.
        """
        for (zone, part), margin, clearance in zip(
            self._kept, margins, self.clearances, strict=True
        ):
            if not zone.table.keep_in and not (margin + clearance > 0.0):
                return f"{spoken(part)} hit the {zone.table.name}{zone.kind.noun}"
        for name, k in zip(self._points, self.parts.ground, strict=True):
            if not (places[k, 2] < 0.0):
                return f"{spoken(name)} hit the ground"
        return None


def zone_table(zones: tuple[Zone, ...]) -> ZoneTable:
    """The zones for kernels."""
    numbers = np.zeros((len(zones), NUMBERS))
    for place, zone in zip(numbers, zones, strict=True):
        begun = zone.table.numbers((0.0, 0.0, 0.0))
        place[: len(begun)] = begun
    legs = [(leg.begins_s, *leg.moved, *leg.velocity) for zone in zones for leg in zone.legs]
    return ZoneTable(
        kind=np.array([KINDS.index(zone.kind) for zone in zones], dtype=np.int64),
        numbers=numbers,
        keep_in=np.array([zone.table.keep_in for zone in zones], dtype=np.bool_),
        clearance=np.array([zone.table.clearance_m for zone in zones], dtype=np.float64),
        touch=np.array([zone.table.touch is not None for zone in zones], dtype=np.bool_),
        follows=np.array([zone.kind.follows_target for zone in zones], dtype=np.bool_),
        legs=np.array(legs).reshape(-1, 7),
        first_leg=np.cumsum([0, *(len(zone.legs) for zone in zones)]).astype(np.int64),
    )


@kernel
def moved(table: ZoneTable, zone: int, time_s: float, target: V3) -> V3:
    """How far a zone has moved [m, NED]; one that follows is as far as ``target`` [m, NED]."""
    if table.follows[zone]:
        return target
    at = table.first_leg[zone]
    while at + 1 < table.first_leg[zone + 1] and table.legs[at + 1, 0] <= time_s:
        at += 1
    since = max(time_s - table.legs[at, 0], 0.0)
    return (
        table.legs[at, 1] + since * table.legs[at, 4],
        table.legs[at, 2] + since * table.legs[at, 5],
        table.legs[at, 3] + since * table.legs[at, 6],
    )


@kernel
def fill_margins(
    table: ZoneTable, parts: Parts, places: Array, time_s: float, target: V3, out: Array
) -> None:
    """Every margin of places (rows, 3) [m, NED] into out (keys,) [m]; ``target`` [m, NED]."""
    i = 0
    for z in range(len(table.kind)):
        shift = moved(table, z, time_s, target)
        if table.follows[z]:
            out[i] = _origin_margin(table, z, shift, places)
            i += 1
            continue
        for b in range(len(parts.form)):
            if not _is_kept(table, z, parts, b):
                continue
            how = (table.kind[z], table.numbers[z], table.keep_in[z], shift, parts, b, places)
            out[i] = part_distance(*how, table.touch[z]) - _clearance(table, z, parts, b)
            i += 1


@compilable
def _is_kept(table: ZoneTable, z: int, parts: Parts, b: int) -> bool:
    """Whether part ``b`` has a margin of a zone: all have, but for a tip that may touch it."""
    return not (table.touch[z] and parts.tool[b] == TIP)


@kernel
def _clearance(table: ZoneTable, z: int, parts: Parts, b: int) -> float:
    """What part ``b`` keeps of a zone [m]: of the tool, nothing where that may touch it."""
    return 0.0 if table.touch[z] and parts.tool[b] == SHAFT else float(table.clearance[z])


@compilable
def _origin_margin(table: ZoneTable, z: int, shift: V3, places: Array) -> float:
    p = (places[0, 0] - shift[0], places[0, 1] - shift[1], places[0, 2] - shift[2])
    d = nearest(table.kind[z], table.numbers[z], p).distance
    return float((-d if table.keep_in[z] else d) - table.clearance[z])


class Headroom(NamedTuple):
    """How far the vehicle can travel before a margin may be smaller than its record.

    No distance changes by more than the part and the surface travel, so that until then nothing
    of it has to be worked out. Overwritten by ``record_if_clear``.
    """

    left: Array  # (margins,) m
    shift: Array  # (zones, 3) m, NED, by which each zone had moved
    places: Array  # (rows, 3) m, NED, and 1 the base's axes: where the vehicle was
    now: Array  # (margins,) m, of one step, infinite where not worked out
    lowest: Array  # (margins,) m, up to that step
    when_s: Array  # (margins,) s, when that was


def headroom(table: ZoneTable, margins: int, rows: int) -> Headroom:
    """Before the first step, with so many ``margins`` and places in ``rows``: none."""
    nowhere = np.full((len(table.kind), 3), math.nan)
    before = np.full((rows, 3), math.nan)
    return Headroom(np.zeros(margins), nowhere, before, *np.zeros((3, margins)))


@kernel
def record_if_clear(
    table: ZoneTable,
    parts: Parts,
    aim: tuple[Array, float],
    places: Array,
    instants: tuple[float, float],
    lowest: Array,
    when_s: Array,
    room: Headroom,
) -> float:
    """``World.margins`` of plant steps without any incident, into the record of the smallest.

    A margin that can be no smaller than what is recorded is not worked out.

    Args:
        table: Zones of a World.
        parts: Parts of a World.
        aim: The end-effector's ``curve_row`` and when it begins [s]; an empty row where no zone
            rides on the target.
        places: (steps, rows, 3) [m, NED], as ``sitl.plant.kinematics.places_of_bodies`` has them.
        instants: Time one step before the first, and between two steps [s].
        lowest: (margins,) [m], smallest so far.
        when_s: (margins,) [s], when that was.
        room: Of the steps so far.

    Returns:
        How far all may travel until there can be an incident, if no zone moves [m]; or minus
        infinity, with nothing recorded, if any point is not clearly above ground or any part not
        within every margin.
    """
    before_s, step_s = instants
    curve, starts_s = aim
    for i in range(lowest.shape[0]):
        room.lowest[i], room.when_s[i] = lowest[i], when_s[i]
    for k in range(places.shape[0]):
        time_s = before_s + (k + 1) * step_s
        target = (0.0, 0.0, 0.0)
        if curve.shape[0]:
            target = place_on_curve(curve, time_s - starts_s)
        for i in range(lowest.shape[0]):
            room.now[i] = math.inf
        if not _is_clear(table, parts, places[k], time_s, target, lowest, room):
            return -math.inf
        for i in range(lowest.shape[0]):
            if room.now[i] < room.lowest[i]:
                room.lowest[i], room.when_s[i] = room.now[i], time_s
    for i in range(lowest.shape[0]):
        lowest[i], when_s[i] = room.lowest[i], room.when_s[i]
    return _free(parts, places[places.shape[0] - 1], lowest, room.left)


@compilable
def _free(parts: Parts, places: Array, lowest: Array, left: Array) -> float:
    """How far all may travel from ``places`` (rows, 3) [m, NED] until there can be an incident."""
    free = math.inf
    for i in range(parts.ground.shape[0]):
        free = min(free, -places[parts.ground[i], 2])
    for i in range(lowest.shape[0]):
        free = min(free, left[i] + _held_back(lowest[i]))
    return max(free, 0.0)


@compilable
def _is_clear(
    table: ZoneTable,
    parts: Parts,
    places: Array,
    time_s: float,
    target: V3,
    lowest: Array,
    room: Headroom,
) -> bool:
    """Whether one step had no incident; the margins that may be below the lowest go to ``now``."""
    for k in range(parts.ground.shape[0]):
        if not places[parts.ground[k], 2] < 0.0:
            return False
    path = travelled(room.places, places, parts.axes, parts.reach)
    i = 0
    for z in range(len(table.kind)):
        shift = moved(table, z, time_s, target)
        by = sub(shift, row(room.shift, z))
        put_row(room.shift, z, shift)
        away = path + math.sqrt(dot(by, by))
        for b in range(1 if table.follows[z] else len(parts.form)):
            if not _is_kept(table, z, parts, b):
                continue
            room.left[i] -= away
            if not room.left[i] > 0.0:
                room.left[i] = _look(table, z, shift, parts, b, places, lowest[i], room.now, i)
                if room.left[i] == -math.inf:
                    return False
            i += 1
    return True


@compilable
def travelled(before: Array, places: Array, axes: int, reach: float) -> float:
    """As ``travel``, from ``before`` (rows, 3) to ``places`` (rows, 3) [m, NED], kept there.

    No part is farther from the base's origin than ``reach`` [m].
    """
    path = travel(before, places, axes, reach)
    for r in range(places.shape[0]):
        put_row(before, r, row(places, r))
    return path


@compilable
def travel(before: Array, places: Array, axes: int, reach: float) -> float:
    """No place of any part has moved farther [m] from ``before`` to ``places``.

    ``before`` and ``places`` are (rows, 3) [m, NED], from row ``axes`` on the base's axes [1, NED].
    No part is farther from the base's origin than ``reach`` [m].
    """
    most, turn = 0.0, 0.0
    for r in range(places.shape[0]):
        by = sub(row(places, r), row(before, r))
        square = dot(by, by)
        if r >= axes:
            turn += square
        elif not (square <= most):  # written so that what is not a number remains
            most = square
    return math.sqrt(most) + reach * math.sqrt(turn)


@kernel
def _look(
    table: ZoneTable,
    z: int,
    shift: V3,
    parts: Parts,
    b: int,
    places: Array,
    lowest: float,
    margins: Array,
    i: int,
) -> float:
    """Work out a margin, into entry ``i`` of margins if it may be below its ``lowest`` [m].

    Returns how far all may travel until it may be so again [m]; minus infinity where the part is
    not within the margin.
    """
    if table.follows[z]:
        margins[i] = _origin_margin(table, z, shift, places)
        return _left(margins[i], lowest)
    how = (table.kind[z], table.numbers[z], table.keep_in[z], shift, parts, b, places)
    clearance = _clearance(table, z, parts, b)
    lower = part_bound(*how, table.touch[z]) - clearance
    left = _left(lower, lowest)
    if parts.form[b] == BALL:  # whose bound is the distance
        margins[i] = lower
    elif not left > _WORTH:
        margin = part_distance(*how, table.touch[z]) - clearance
        left = _left(margin, lowest)
        if not (lower > 0.0 and lowest <= lower):
            margins[i] = margin
    return left


@kernel
def _left(margin: float, lowest: float) -> float:
    """How far a part with at least this margin [m] may travel before it can be a record [m].

    Or before there is none left; minus infinity if there is none now.
    """
    if not margin > 0.0:
        return -math.inf
    return margin - _held_back(lowest) - _ROUNDING


@compilable
def _held_back(lowest: float) -> float:
    """The margin [m] that is a record, given the ``lowest`` [m] so far."""
    return min(max(lowest, 0.0), _FAR)
