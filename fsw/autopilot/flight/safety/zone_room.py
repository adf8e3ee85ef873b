r"""What room and what speed a zone may take to drive a vehicle out of it.

Outside of a zone the barrier asks for a speed back, :math:`n\cdot v \ge k_S\,|d| + \lambda`, and
that grows without bound with the depth. So clearances shrink, as far as it needs:

* no barrier asks for more than the largest speed of a setpoint, the zone's own included, which
  is taken to be slower where it is more than that alone,
* a zone that the vehicle is in deeper than ``ROOM`` stands where it is, well away from the vehicle:
  no way out is known to be right. The failsafe table holds, and lands,
* and one that would push it below the lowest height of a reference ends there, and drives it the
  slower the lower it is.

Margins and failsafes go on to be of the safe set in force.
"""

from __future__ import annotations

import math
import operator
from typing import Final

from fsw.autopilot.barriers.safe_approach import BarrierTuning, stand_off
from fsw.autopilot.control.safety_filter import ROOM
from fsw.autopilot.flight.safety.safe_set_change import held
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.geometry.vectors import clamp, dot
from fsw.autopilot.model.body import hull_reach
from fsw.autopilot.parameters.flight_config import FlightConfig, lowest_height
from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.zones import surface
from fsw.autopilot.signals import (
    ConstraintReport,
    EndEffectorTarget,
    SafeSet,
    StateEstimate,
    Vec3,
    Zone,
)
from fsw.frozen import replace

_BRAKING: Final = 1.0  # m/s^2, that are counted on above the ground
_FREE: Final = 0.5  # m; a boundary that came along without any would let nothing back
_DOWNWARD: Final = 0.1  # of a normal, from which on it leads to the ground
_STILL: Final[Vec3] = (0.0, 0.0, 0.0)


class ZoneRoom:
    """The room of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._walls, self._workspace = config.planner.tunings
        self._speed = config.steering.speed
        self._lowest, self._legs = lowest_height(config), config.airframe.leg_length
        self._limits = config.keeps_barriers

    def limit(
        self,
        kept: InflatedSafeSet,
        report: ConstraintReport,
        estimate: StateEstimate,
        target: EndEffectorTarget | None,
    ) -> InflatedSafeSet:
        """The set to keep, of whose source the ``report`` says the margins now."""
        if not self._limits or not report.per_zone:
            return kept
        zones, given, first = list(kept.safe_set.zones), [0.0] * len(report.per_zone), 0
        for k, count in enumerate(report.per_zone):
            margin, first = min(report.margins[first : first + count]), first + count
            distance = margin - (kept.added[k] if kept.added else 0.0)
            follows = kind_of(zones[k].shape).follows_target
            tuning = self._workspace if follows else self._walls
            # Farther away, a barrier asks for no speed: S is more than lambda and the zone's own.
            moving = math.hypot(*_velocity(zones[k], target))
            if not tuning.approach_speed(distance) < tuning.lambda_ + moving:
                continue
            least, share = self._least(kept, k, margin, tuning, estimate, target)
            if share < 1.0:
                zones[k] = _slowed(zones[k], share, estimate.t_us)
            if distance < least:
                given[k] = least - distance
                zones[k] = replace(zones[k], clearance=zones[k].clearance - given[k])
        if not any(given) and all(map(operator.is_, zones, kept.safe_set.zones)):
            return kept
        return kept._replace(safe_set=SafeSet(tuple(zones)), given=tuple(given))

    def _least(
        self,
        kept: InflatedSafeSet,
        k: int,
        margin: float,
        tuning: BarrierTuning,
        estimate: StateEstimate,
        target: EndEffectorTarget | None,
    ) -> tuple[float, float]:
        """The least distance [m] at which a zone is to be seen, and the share of its speed [1]."""
        rest, at = stand_off(tuning), surface(kept.source, k, estimate.p_WB, estimate.t_us, target)
        if at is None or not margin > -ROOM:
            return rest + _FREE, 0.0
        moves = _velocity(kept.source.zones[k], target)
        # Legs that slide over the ground tip the vehicle over.
        height = -estimate.p_WB[2] - self._legs
        speed = self._speed * clamp(height / (self._lowest - self._legs), 0.0, 1.0)
        comes, most = max(dot(at.normal, moves), 0.0), max(speed - tuning.lambda_, 0.0)
        share = min(1.0, most / comes) if comes > 0.0 else 1.0
        least, down = -max(most - comes, 0.0) / tuning.slope, at.normal[2]
        if down > _DOWNWARD:
            sinks = max(estimate.v_WB[2], 0.0)
            room = -estimate.p_WB[2] - self._lowest - sinks * sinks / (2.0 * _BRAKING)
            least = max(least, rest - room / down)  # and back up, from below
            if not room > 0.0:
                share = 0.0
        return least, share


def _velocity(zone: Zone, target: EndEffectorTarget | None) -> Vec3:
    """Of a zone [m/s, NED], or of the ``target`` that it follows."""
    follows = target is not None and kind_of(zone.shape).follows_target
    return target.v_WE if follows and target is not None else zone.velocity


def _slowed(zone: Zone, share: float, now_us: int) -> Zone:
    """A zone from where it is now on at a ``share`` [1] of its speed."""
    if zone.velocity == _STILL:
        return zone
    vx, vy, vz = zone.velocity
    velocity = (share * vx, share * vy, share * vz)
    return replace(held(zone, now_us - zone.t_us), velocity=velocity, t_us=now_us)


def within_room(config: FlightConfig, safe_set: SafeSet, estimate: StateEstimate) -> SafeSet:
    """The zones that a vehicle may draw back from."""
    zones, body = [], config.body
    for k, zone in enumerate(safe_set.zones):
        at = surface(safe_set, k, estimate.p_WB, estimate.t_us)
        if at is not None and at.distance - hull_reach(body, at.normal) > -ROOM:
            zones.append(zone)
    return SafeSet(tuple(zones))


def is_deep(report: ConstraintReport) -> bool:
    """Whether a margin is more negative than a vehicle draws back from."""
    least = min(report.margins, default=math.inf)
    return not least > -ROOM
