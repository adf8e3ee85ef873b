"""The numbers of a tick, in the order in which they come, as one compiled call.

======  ===========================================  ======================  =======================
stage   law                                          reads                   writes
======  ===========================================  ======================  =======================
EXPECT  ``expect_next_tick``, ``cascade.py``         record before the tick  ``expected`` of request
FRAME   ``read_into``, ``estimation/estimator.py``   reading                 estimate
filter  ``run_filter``, ``estimation/kernels.py``    request, filter         filter, estimate
CALM    ``move_plan``, ``model/nominal.py``          plan, u                 plan
LOOPS   ``close_loops``, ``control/cascade.py``      estimate, plan, u       sent, flags, the rest
======  ===========================================  ======================  =======================

``filter_parts`` says which parts of the estimator's filter are done. All stages are of every tick
(500 Hz). A calm one (``calm_tick.py``) is one call of all; any other asks for some at a time,
and decides in between. Other sensors (``fuse``), the watch over the actuators and the planner have
calls of their own: the actuators do not wait for them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.control.cascade import (
    Cascade,
    KeepClear,
    close_loops,
    compare_with_plan,
    expect_next_tick,
    note_weight,
)
from fsw.autopilot.control.px4_loops import Px4Loops
from fsw.autopilot.control.safety_filter import FilterProbes
from fsw.autopilot.control.tube import NO_TUBE, TubeAround
from fsw.autopilot.estimation.error_state import Filter, Law
from fsw.autopilot.estimation.estimator import READINGS, read_into
from fsw.autopilot.estimation.fusion_memory import at_start
from fsw.autopilot.estimation.kernels import FINITE, Asked, run_filter
from fsw.autopilot.estimation.sensor_fusion import FilterCall
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.model.actuator_health import HEALTHY, ActuatorHealth, note_health
from fsw.autopilot.model.nominal import NominalModel, move_plan
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.shapes.zones import NO_ZONES, Zones
from fsw.autopilot.tick_record import IMPAIRED, Expected, Tick
from fsw.compiled import kernel, machine_code, packed
from fsw.frozen import replace
from fsw.record import Floats

EXPECT, EXPLAINS, JUDGED, FRAME, CALM, LOOPS = 1, 2, 4, 8, 16, 32
BELIEVED: Final = 8  # beside what came of the filter's parts: all stages were done


def loops_of(config: FlightConfig) -> Cascade:
    """The loops of a configuration: our own, or what asks PX4's."""
    tick, clear = config.tick, _keep_clear(config)
    if config.is_above_px4:
        return Px4Loops(config.airframe, config.tuning, config.px4, tick, clear)
    return Cascade(config.airframe, config.tuning, config.inner, tick, clear)


def _keep_clear(config: FlightConfig) -> KeepClear:
    """What the safety filter keeps off zones; it works where the planner has barriers to rely on.

    Controllers that are flown for comparison are to show what they do without it.
    """
    enabled = config.safety_filter.enabled and config.keeps_barriers
    return KeepClear(
        config.body,
        config.planner.tunings,
        replace(config.safety_filter, enabled=int(enabled)),
        config.steering.speed,
    )


@kernel
def fast_loop(
    laws: NDArray[Any],
    models: NDArray[Any],
    records: NDArray[Any],
    stages: int,
    ticks: int,
    zones: Floats,
    probes: FilterProbes,
    tube: TubeAround,
    upright: float,
    reading: Floats,
    filters: Filter,
    estimators: Law,
    requests: NDArray[Any],
    filter_parts: int,
    now: float,
    until: float,
) -> int:
    """Do some ``stages`` [1] and, between them, ``filter_parts`` [1]; what came of these.

    ``laws`` and ``models`` (1,) [SI] are of the loops and the plan, the record is that of
    ``records`` (1,) [SI], and ``reading`` (READINGS,) [SI] is of an exact state. A CALM tick ends
    early unless the state is believed and as near to level as the cosine ``upright`` [1] says. So
    many ``ticks`` [1] are closed at once, as ``close_loops`` has it. ``requests`` (1,) [SI],
    ``now`` [s] and ``until`` [s] are of ``run_filter``, of which one tick may take several calls:
    the loops are closed by the last.
    """
    law, r, asked = laws[0], records[0], requests[0]
    found, known = 0, True
    if stages & EXPECT:
        explains, judged = stages & EXPLAINS != 0, stages & JUDGED != 0
        expect_next_tick(r, law.airframe, law.rotor_decay, asked.expected, explains, judged)
    if stages & FRAME:
        known = read_into(r.estimate, reading, asked.t_us) == 0
    if filter_parts:
        found = run_filter(filters[0], estimators[0], asked, filter_parts, now, until)
        known = found & FINITE != 0
        if stages & LOOPS and known:
            r.estimate = asked.present
    if stages & CALM:
        known = known and r.estimate.R_WB[8] > upright
        if known:
            move_plan(models[0], r.plan, r.u, r.joint_count)
    if stages & LOOPS and known:
        close_loops(r, law, ticks, zones, probes)
        compare_with_plan(r, tube)
        note_weight(r, law.airframe)
    return found | BELIEVED if known else found


class FastLoop:
    """The fast loop of one configuration; it holds nothing from call to call."""

    def __init__(self, cascade: Cascade, model: NominalModel, tuning: EstimatorTuning) -> None:
        """Of these loops, or of those that ask PX4's; the filter has a ``tuning``."""
        self.law, self._probes, self._asked = cascade.law, cascade.probes, Asked()
        self._px4 = cascade if isinstance(cascade, Px4Loops) else None
        joints, request = cascade.law.airframe.bodies.joints, self._asked.array
        laws, r = (cascade.packed, model.packed), Tick().array
        no_loops = 0, 1, NO_ZONES, cascade.probes, NO_TUBE, 1.0
        self._no_frame = np.frombuffer(bytes(8 * READINGS))
        self._no_filter = at_start(joints).numbers, packed(tuning), request, 0, 0.0, 0.0
        example = *laws, r, *no_loops, self._no_frame, *self._no_filter
        compiled: Callable[..., int] = machine_code(fast_loop, *example)
        self._call = partial(compiled, *laws)
        # The filter's parts alone.
        self.filter: FilterCall = partial(self._call, r, *no_loops, self._no_frame)

    def expected(self, r: Tick, *, explains: bool = True, judged: bool = False) -> Expected:
        """What the commands sent last make of joints and vehicle; it is good until the next call.

        ``explains`` and ``judged`` are of ``expect_next_tick``.
        """
        self._do(r, EXPECT | (EXPLAINS if explains else 0) | (JUDGED if judged else 0))
        return self._asked.expected

    def step(
        self,
        r: Tick,
        ticks: int = 1,
        zones: Zones = NO_ZONES,
        health: ActuatorHealth = HEALTHY,
        tube: TubeAround = NO_TUBE,
    ) -> None:
        """Close the loops of a record; see ``close_loops``."""
        if self._px4 is not None:
            self._px4.ask(r, ticks, zones, tube)
            return
        if health is not HEALTHY or r.flags & IMPAIRED:
            note_health(r.health, health)
            r.flags = 0 if health is HEALTHY else IMPAIRED
        self._do(r, LOOPS, ticks, zones, tube)

    def exact(
        self, r: Tick, reading: Floats, now_us: int, upright: float, zones: Zones, tube: TubeAround
    ) -> bool:
        """Fly a calm tick of an exact state ``reading`` (READINGS,) [SI]; whether it was one.

        It came at ``now_us``; ``upright`` [1] is the cosine of the tilt up to which it is calm.
        """
        self._asked.t_us = now_us
        stages = FRAME | CALM | (LOOPS if self._px4 is None else 0)
        loops = r.array, stages, 1, zones, self._probes, tube, upright
        calm = self._call(*loops, reading, *self._no_filter) & BELIEVED != 0
        if calm and self._px4 is not None:
            self._px4.ask(r, 1, zones, tube)
        return calm

    def calm(self, r: Tick, upright: float, zones: Zones, tube: TubeAround) -> FilterCall:
        """The filter's call that flies a calm tick of a suite as well: BELIEVED if it was one.

        ``upright`` [1] as in ``exact``. Of our own loops.
        """
        stages = EXPECT | EXPLAINS | JUDGED | CALM | LOOPS
        loops = r.array, stages, 1, zones, self._probes, tube, upright
        return partial(self._call, *loops, self._no_frame)

    def _do(
        self,
        r: Tick,
        stages: int,
        ticks: int = 1,
        zones: Zones = NO_ZONES,
        tube: TubeAround = NO_TUBE,
    ) -> None:
        loops = r.array, stages, ticks, zones, self._probes, tube, 1.0
        self._call(*loops, self._no_frame, *self._no_filter)
