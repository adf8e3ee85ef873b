"""Everything that a scenario keeps the vehicle out of or inside of, as zones that may move."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

from sitl.scenario import V3, Scenario, ScenarioZone
from sitl.shapes import kind_of
from sitl.shapes.ball import Ball
from sitl.shapes.half_space import HalfSpace
from sitl.shapes.kind import ShapeKind
from sitl.shapes.target_sphere import TargetSphere

_STILL: V3 = (0.0, 0.0, 0.0)


class Leg(NamedTuple):
    """A part of a zone's movement, up to the next one."""

    begins_s: float
    moved: V3  # m, NED, until then
    velocity: V3  # m/s, NED, from then on


class Placed(NamedTuple):
    """Where a zone is at one time."""

    numbers: tuple[float, ...]  # of PANDION_SHAPE
    velocity: V3  # m/s, NED


@dataclass(frozen=True, slots=True)
class Zone:
    """One zone, its shape and its movement."""

    table: ScenarioZone
    kind: ShapeKind
    legs: tuple[Leg, ...]

    @property
    def moves(self) -> bool:
        """Whether it is not always at the same place."""
        return len(self.legs) > 1 or self.legs[0].velocity != _STILL

    def at(self, time_s: float) -> Placed:
        """The zone at a time since the start of the simulation."""
        leg = self.legs[0]
        for later in self.legs[1:]:
            if later.begins_s > time_s:
                break
            leg = later
        since = max(time_s - leg.begins_s, 0.0)
        (x, y, z), (vx, vy, vz) = leg.moved, leg.velocity
        moved = (x + since * vx, y + since * vy, z + since * vz)
        return Placed(self.table.numbers(moved), leg.velocity)


def zones_of(scenario: Scenario) -> tuple[Zone, ...]:
    """Walls, obstacles, zones and the workspace of a scenario, in this order."""
    tables: list[ScenarioZone] = [
        HalfSpace(
            name=wall.name,
            clearance_m=wall.clearance_m,
            normal=wall.normal,
            offset_m=wall.offset_m,
        )
        for wall in scenario.walls
    ]
    tables += [
        Ball(name=one.name, clearance_m=one.clearance_m, centre_m=one.position_m, radius_m=0.0)
        for one in scenario.obstacles
    ]
    tables += scenario.zones
    sphere = scenario.workspace
    if sphere is not None:
        above = (0.0, 0.0, -sphere.d_iw_m)
        tables.append(TargetSphere(name="workspace", offset_m=above, radius_m=sphere.radius_m))
    return tuple(Zone(table, kind_of(table), _legs(table)) for table in tables)


def _legs(table: ScenarioZone) -> tuple[Leg, ...]:
    points = table.way_points
    if not points:
        if table.velocity_m_s == _STILL:
            return (Leg(0.0, _STILL, _STILL),)
        moving = Leg(table.starts_s, _STILL, table.velocity_m_s)
        return (moving,) if table.starts_s == 0.0 else (Leg(0.0, _STILL, _STILL), moving)
    # It waits at the first way point until its time, and stays at the last.
    legs = [Leg(0.0, points[0].moved_m, _STILL)]
    for here, there in itertools.pairwise(points):
        takes = there.time_s - here.time_s  # > 0, as sitl.scenario_validation makes sure
        x, y, z = ((b - a) / takes for a, b in zip(here.moved_m, there.moved_m, strict=True))
        legs.append(Leg(here.time_s, here.moved_m, (x, y, z)))
    legs.append(Leg(points[-1].time_s, points[-1].moved_m, _STILL))
    return tuple(legs)
