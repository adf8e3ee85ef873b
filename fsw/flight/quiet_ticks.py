"""Ticks of a flight in which nothing happens, each as three compiled calls on its record.

Between two planning periods most ticks believe the sensors, move the plan's state on and close the
loops; no command comes, no limit is met, no failsafe acts. Such ticks need no other part of the
state, no snapshot and no texts. Studies fly them so, in a ninth of the time of ``Autopilot.tick``.
A tick that is not of this kind is left to that, with the state as it was before. The flight is the
same to the last bit, which tests compare.

Only exact states are flown so: what a suite of sensors says has to be looked at one by one.

Source: docs/decisions/0037-quiet-ticks.md.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.compiled import compilable, kernel, machine_code
from fsw.control.actuator_watch import Watch, at_start, blank, watch
from fsw.control.cascade import Cascade
from fsw.estimation.estimator import attitude
from fsw.flight.active_failsafes import surely_none
from fsw.flight.failsafe import SLOW_US
from fsw.flight.failsafe_evidence import PLAN_STALE_PERIODS
from fsw.flight.plan_exchange import planned_input
from fsw.flight.safety_watch import off_plan_bound
from fsw.flight.state import AIDED, FlightState
from fsw.frozen import replace
from fsw.model.actuator_health import HEALTHY
from fsw.model.nominal import NominalModel, next_state, put_plan
from fsw.parameters.flight_config import FlightConfig
from fsw.shapes.zones import NO_ZONES, Array
from fsw.signals import Mode, Vec2, Vec4
from fsw.tick_record import IMPAIRED, Estimate, Tick

READINGS: Final = 20
"""Numbers of a frame: position, velocity, quaternion, gyro, accelerometer, joints, their rates."""


class Bounds(NamedTuple):
    """Between which a tick is quiet."""

    off_plan: float  # m, on each axis
    upright: float  # cosine of the tilt
    tick: float  # s
    decay: float  # of a rotor's error in a tick


@kernel
def _sense(
    model: NDArray[Any], ticks: NDArray[Any], reading: Array, now_us: int, bounds: Bounds
) -> bool:
    """Read a frame and move the plan's state on. False: there is something to be looked at.

    ``reading`` (READINGS,) [SI]. Reads plan, u; writes estimate, plan.
    """
    r = ticks[0]
    x = r.estimate
    if read_into(x, reading, now_us) or not x.R_WB[8] > bounds.upright:
        return False
    put_plan(r.plan, next_state(model[0], r.plan, r.u))
    within = True
    for i in range(3):
        within = within and -bounds.off_plan <= x.p_WB[i] - r.plan.p[i] <= bounds.off_plan
    return within


@kernel
def _watch(
    before: NDArray[Any],
    after: NDArray[Any],
    watched: Watch,
    watching: Watch,
    airframe: NDArray[Any],
    bounds: Bounds,
) -> bool:
    """Watch the actuators over a tick, from ``watched`` to ``watching``; whether one has failed."""
    sent, r = before[0].sent, after[0]
    f, x = sent.rotor_thrust, r.estimate
    return watch(
        watched,
        watching,
        airframe,
        bounds.decay,
        bounds.tick,
        (f[0], f[1], f[2], f[3]),
        (sent.joint_torque[0], sent.joint_torque[1]),
        (r.joints.reference[0], r.joints.reference[1]),
        (x.w_WB_B[0], x.w_WB_B[1], x.w_WB_B[2]),
        (x.q_arm[0], x.q_arm[1]),
        (x.qd_arm[0], x.qd_arm[1]),
        x.specific_force,
        True,
    )


@compilable
def read_into(x: Estimate, reading: Array, now_us: int) -> int:
    """The estimate of a ``reading`` (READINGS,) [SI]; which parts of that cannot be."""
    s = reading
    p, v, w = (s[0], s[1], s[2]), (s[3], s[4], s[5]), (s[10], s[11], s[12])
    q_arm, qd_arm = (s[16], s[17]), (s[18], s[19])
    missing, R, x.yaw = attitude(
        p, v, (s[6], s[7], s[8], s[9]), w, (s[13], s[14], s[15]), q_arm, qd_arm
    )
    for i in range(3):
        x.p_WB[i], x.v_WB[i], x.w_WB_B[i] = p[i], v[i], w[i]
    for i in range(9):
        x.R_WB[i] = R[i]
    for i in range(len(q_arm)):
        x.q_arm[i], x.qd_arm[i] = q_arm[i], qd_arm[i]
    x.t_us, x.specific_force = now_us, -s[15]
    return missing


class QuietTicks:
    """Flies the quiet ticks of one configuration, from one state of the flight software on."""

    def __init__(
        self,
        config: FlightConfig,
        cascade: Cascade,
        model: NominalModel,
        airframe: NDArray[Any],
        decay: float,
        upright: float,
        radius: float,
    ) -> None:
        """Of the laws that the tick of this configuration has.

        A rotor's error shrinks by ``decay`` [1] a tick; beyond the ``radius`` [m], and less
        ``upright`` [1] than that, a tick is not quiet.
        """
        self._config, self._tick_us = config, config.tick_period_us
        self._per_plan = config.mpc_period_us // config.tick_period_us
        self._radius = radius
        self._cascade, self._model, self._airframe = cascade, model.packed, airframe
        self._bounds = Bounds(radius, upright, 1e-6 * self._tick_us, decay)
        self._before = Tick()
        self._watched, self._watching = at_start(), blank()
        self._zones = NO_ZONES
        self._flown, self._since_us = 0, 0
        ticks = self._before.array, self._before.array
        reading = np.zeros(READINGS)
        self._sense = machine_code(_sense, self._model, ticks[0], reading, 0, self._bounds)
        memory = self._watched, self._watching
        self._watch = machine_code(_watch, *ticks, *memory, airframe, self._bounds)

    def begin(self, state: FlightState, zones: Array) -> int:
        """How many ticks after this state may be quiet; none: 0.

        ``zones`` (zones, k) [SI] are those of the safety filter, which stay the same meanwhile.
        """
        self._flown, ticks = 0, self._most(state)
        if ticks <= 0:
            return 0
        plan, x, nominal = state.plan.running, state.estimate, state.nominal
        assert plan is not None
        assert x is not None
        assert nominal is not None
        u = planned_input(plan, state.t_us)
        now = planned_input(plan, state.t_us + self._tick_us)
        if u is None or u is not now:
            return 0  # a tick is flown with two inputs
        self._zones, self._since_us = zones, state.t_us
        self._bounds = self._bounds._replace(
            off_plan=off_plan_bound(self._radius, state.accuracy.reach)
        )
        self._before = state.cascade.copy()
        self._before.give(x, nominal, u)
        self._watched = at_start() if state.watch is None else state.watch
        self._watching = blank()
        return ticks

    def tick(self, reading: Array) -> tuple[bool, Vec4, Vec2]:
        """One tick with a ``reading`` (READINGS,) [SI]: whether it was quiet, and its command.

        Rotors [N] and joints [N m]. If it was not, the tick is still to be flown.
        """
        before, after = self._before, self._before.copy()
        now_us = self._since_us + (self._flown + 1) * self._tick_us
        quiet = self._sense(self._model, after.array, reading, now_us, self._bounds)
        if quiet:
            self._cascade.close(after, self._zones)
            quiet = not after.flags and after.margin >= 0.0
        if quiet:
            memory = self._watched, self._watching
            ticks = before.array, after.array
            quiet = not self._watch(*ticks, *memory, self._airframe, self._bounds)
        if quiet:
            self._flown += 1
            self._before = after
            # The first one is the state's own.
            given = self._watched if self._flown > 1 else blank()
            self._watched, self._watching = self._watching, given
        return quiet, *after.commanded

    def end(self, state: FlightState) -> FlightState:
        """The state after all quiet ticks that followed on a ``state``."""
        if not self._flown:
            return state
        t_us = state.t_us + self._flown * self._tick_us
        estimate, nominal = self._before.given()
        return replace(
            state,
            index=state.index + self._flown,
            t_us=t_us,
            estimate=estimate,
            nominal=nominal,
            cascade=self._before,
            watch=self._watched,
        )

    def _most(self, state: FlightState) -> int:
        """How many ticks after this state no clock or plan ends; 0: it is not quiet."""
        if not _is_quiet(state, self._config):
            return 0
        plan, mission, now_us = state.plan, state.mission, state.t_us
        running = plan.running
        assert running is not None
        step = (now_us + self._tick_us - running.t_us) // running.period_us
        ends_us = [
            (now_us // SLOW_US + 1) * SLOW_US,
            running.t_us + (step + 1) * running.period_us,
            plan.since_us + PLAN_STALE_PERIODS * self._config.planner.period_us + 1,
            mission.stream[-1].t_us + 1,
        ]
        if plan.awaited_id >= 0:
            ends_us.append(plan.awaited_us)
        return min(
            (min(ends_us) - now_us - 1) // self._tick_us,
            self._per_plan - 1 - state.index % self._per_plan,
        )


def _is_quiet(state: FlightState, config: FlightConfig) -> bool:
    """Whether nothing goes on that a quiet tick does not know of."""
    vehicle, plan, estimate = state.vehicle, state.plan, state.estimate
    return (
        vehicle.mode is Mode.TRAJECTORY
        and vehicle.flies
        and vehicle.home is not None
        and state.fusion is None
        and state.nominal is not None
        and estimate is not None
        and estimate.t_us == state.t_us
        and state.index >= 0
        and state.invalid_ticks == 0
        and not state.tuning
        and state.aiding is AIDED
        and not (state.damage.rotor or state.damage.joint)
        and state.damage.health is HEALTHY
        and not state.cascade.flags & IMPAIRED
        and bool(config.limits.watches_actuators)
        and bool(state.mission.stream)
        and plan.running is not None
        and state.t_us >= plan.since_us
        and surely_none(state, estimate, config)
    )
