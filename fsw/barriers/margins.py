"""How far inside its safe set the vehicle is now, for telemetry and the failsafes."""

from __future__ import annotations

import numpy as np

from fsw.barriers.safe_approach import BarrierTuning
from fsw.barriers.zone_rows import Moves, Tunings, fill_starts
from fsw.compiled import of_fixed_types
from fsw.model.body import Body
from fsw.model.linearisation import Horizon
from fsw.model.prediction import INPUTS, Q_ARM, QD_ARM, STATES, P, V
from fsw.shapes.zones import shifts, zone_arrays
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
        self._tunings = Tunings(*(tuning.numbers(period) for tuning in tunings))
        self._fill = of_fixed_types(fill_starts)

    def report(
        self, safe_set: SafeSet, estimate: StateEstimate, target: EndEffectorTarget | None
    ) -> ConstraintReport:
        """Margins and barrier values of the vehicle; the sphere hangs on the target.

        There is one of each zone and part, zone by zone; of a zone that follows the target a
        single one, and none while there is no target.
        """
        zones = zone_arrays(safe_set)
        if not safe_set.zones or (target is None and zones.follows.any()):
            return ConstraintReport(safe_set.kind)
        p_target, v_target = np.zeros((1, 3)), np.zeros((1, 3))
        if target is not None:
            p_target[0], v_target[0] = target.p_WE, target.v_WE
        moves = Moves(*shifts(safe_set, np.array([estimate.t_us]), p_target, v_target))
        vehicle = as_horizon(estimate, self._links)
        size = sum(1 if follows else len(self.parts) for follows in zones.follows)
        margins, values = np.empty(size), np.empty(size)
        how = (zones, moves, self._probes, vehicle, self._tunings)
        self._fill(*how, True, margins)
        self._fill(*how, False, values)
        return ConstraintReport(safe_set.kind, tuple(margins.tolist()), tuple(values.tolist()))


def as_horizon(estimate: StateEstimate, links: Vec2) -> Horizon:
    """The vehicle itself as a horizon of one node; ``links`` [m]."""
    state = np.zeros((1, STATES))
    state[0, P : P + 3], state[0, V : V + 3] = estimate.p_WB, estimate.v_WB
    state[0, Q_ARM : Q_ARM + 2], state[0, QD_ARM : QD_ARM + 2] = estimate.q_arm, estimate.qd_arm
    rotation = np.array(estimate.R_WB).reshape(3, 3)
    wx, wy, wz = estimate.w_WB_B
    turning = np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, wz, -wy), (wy, -wx, 0.0)))
    axes = (turning @ rotation.T).reshape(1, 4, 3)
    nothing = np.zeros((1, 4, 4, 3))
    return Horizon(state, axes, nothing, np.zeros((1, STATES, INPUTS)), links)
