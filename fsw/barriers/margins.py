"""How far inside its safe set the vehicle is now, for telemetry and the failsafes."""

from __future__ import annotations

import numpy as np

from fsw.barriers.safe_approach import BarrierTuning
from fsw.barriers.zone_rows import fill_starts, settings
from fsw.compiled import of_fixed_types
from fsw.model.body import Body
from fsw.model.linearisation import FRAME, put_arm
from fsw.model.prediction import Array
from fsw.shapes.zones import FOLLOWS, shifts, zone_arrays
from fsw.signals import ConstraintReport, EndEffectorTarget, SafeSet, StateEstimate, Vec2


class Margins:
    """Margins and barrier values of one body."""

    def __init__(
        self,
        body: Body,
        links: Vec2,
        tunings: tuple[BarrierTuning, BarrierTuning],
        period: float,
    ) -> None:
        """Prepare for ``links`` [m] and the planner's ``period`` [s].

        The first of ``tunings`` is for all zones but those that follow the target.
        """
        self.parts = tuple(part.name for part in body.parts)
        self._probes, self._links = body.probes, links
        self._settings = settings(tunings, period)
        self._fill = of_fixed_types(fill_starts)

    def report(
        self, safe_set: SafeSet, estimate: StateEstimate, target: EndEffectorTarget | None
    ) -> ConstraintReport:
        """Margins and barrier values of the vehicle; the sphere hangs on the target.

        There is one of each zone and part, zone by zone; of a zone that follows the target a
        single one, and none while there is no target.
        """
        zones = zone_arrays(safe_set)
        following = zones[:, FOLLOWS] > 0.0
        if not safe_set.zones or (target is None and following.any()):
            return ConstraintReport(safe_set.kind)
        p_target, v_target = np.zeros((1, 3)), np.zeros((1, 3))
        if target is not None:
            p_target[0], v_target[0] = target.p_WE, target.v_WE
        shift, speed = shifts(safe_set, np.array([estimate.t_us]), p_target, v_target)
        vehicle = frame_of(estimate, self._links)
        per_zone = tuple(1 if follows else len(self.parts) for follows in following)
        size = sum(per_zone)
        margins, values = np.empty(size), np.empty(size)
        how = (zones, shift[0], speed[0], self._probes, vehicle, self._settings)
        self._fill(*how, True, margins)
        self._fill(*how, False, values)
        return ConstraintReport(
            safe_set.kind, tuple(margins.tolist()), tuple(values.tolist()), per_zone
        )


def frame_of(estimate: StateEstimate, links: Vec2) -> Array:
    """The vehicle itself as a frame of ``fsw.model.linearisation`` (FRAME,); ``links`` [m]."""
    frame = np.zeros(FRAME)
    rotation = np.array(estimate.R_WB).reshape(3, 3)
    wx, wy, wz = estimate.w_WB_B
    turning = rotation @ np.array(((0.0, -wz, wy), (wz, 0.0, -wx), (-wy, wx, 0.0)))
    frame[:24] = *estimate.p_WB, *estimate.v_WB, *estimate.R_WB, *turning.ravel()
    put_arm(frame, estimate.q_arm, estimate.qd_arm, links)
    return frame
