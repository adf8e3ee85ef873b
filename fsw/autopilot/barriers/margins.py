"""How far inside its safe set the vehicle is now, for telemetry and the failsafes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fsw.autopilot.barriers.safe_approach import BarrierTuning
from fsw.autopilot.barriers.zone_rows import fill_starts, settings
from fsw.autopilot.model.body import Body
from fsw.autopilot.model.kinematics import frame_of
from fsw.autopilot.model.multibody import Bodies
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.shapes.zones import FOLLOWS, all_moving_zones, shifts, zone_arrays
from fsw.autopilot.signals import ConstraintReport, EndEffectorTarget, SafeSet, StateEstimate, Vec3
from fsw.compiled import machine_code

_REST: Vec3 = (0.0, 0.0, 0.0)


class _Known(NamedTuple):
    """A safe set as kernels take it."""

    safe_set: SafeSet
    zones: Array
    moving: Array
    per_zone: tuple[int, ...]  # how many margins each has
    follows_target: bool  # one of them does


class Margins:
    """Margins and barrier values of one body."""

    def __init__(
        self,
        body: Body,
        bodies: Bodies,
        tunings: tuple[BarrierTuning, BarrierTuning],
        period: float,
    ) -> None:
        """Prepare for a vehicle of ``bodies`` and the planner's ``period`` [s].

        The first of ``tunings`` is for all zones but those that follow the target.
        """
        self.parts = tuple(part.name for part in body.parts)
        self._probes, self._bodies = body.probes, bodies
        self._settings = settings(tunings, period)
        self._touching = len(self.parts) - sum(part.tool for part in body.parts)
        self._known = _known(SafeSet(), 0, 0)
        self._fill = machine_code(fill_starts)

    def report(
        self, safe_set: SafeSet, estimate: StateEstimate, target: EndEffectorTarget | None
    ) -> ConstraintReport:
        """Margins and barrier values of the vehicle; the sphere hangs on the target.

        There is one of each zone and part, zone by zone; none of the tool's at a zone that it may
        touch; of a zone that follows the target a single one, and none while there is no target.
        """
        if safe_set is not self._known.safe_set:  # looked at ten times a second, and the same
            self._known = _known(safe_set, len(self.parts), self._touching)
        _, zones, moving, per_zone, follows_target = self._known
        if not per_zone or (target is None and follows_target):
            return ConstraintReport(safe_set.kind)
        p, v = (_REST, _REST) if target is None else (target.p_WE, target.v_WE)
        of_target = np.array((p, v), dtype=np.float64)
        shift, speed = shifts(moving, np.array([estimate.t_us]), of_target[:1], of_target[1:])
        vehicle = frame_of(self._bodies, estimate)
        size = sum(per_zone)
        margins, values = np.empty(size), np.empty(size)
        how = (zones, shift[0], speed[0], self._probes, vehicle, self._settings)
        self._fill(*how, True, margins)
        self._fill(*how, False, values)
        return ConstraintReport(
            safe_set.kind, tuple(margins.tolist()), tuple(values.tolist()), per_zone
        )


def _known(safe_set: SafeSet, parts: int, touching: int) -> _Known:
    """What is known of a safe set, of which most zones have a margin for each of ``parts`` [1].

    A zone that the tool may touch has one for each of ``touching`` [1], which are not the tool's.
    """
    zones = zone_arrays(safe_set)
    follows = [zone[FOLLOWS] > 0.0 for zone in zones.tolist()]
    kept = [parts if zone.touch is None else touching for zone in safe_set.zones]
    per_zone = tuple([1 if rides else count for rides, count in zip(follows, kept, strict=True)])
    return _Known(safe_set, zones, all_moving_zones(safe_set), per_zone, any(follows))
