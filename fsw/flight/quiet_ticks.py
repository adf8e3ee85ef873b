"""Ticks of a flight in which nothing happens, each as one compiled call.

Between two planning periods most ticks believe the sensors, move the plan's state on and close the
loops; no command comes, no limit is met, no failsafe acts. Such ticks need no other part of the
state, no snapshot and no texts. Studies fly them so, in a ninth of the time of ``Autopilot.tick``.
A tick that is not of this kind is left to that, with the state as it was before. The flight is the
same to the last bit, which tests compare.

Only exact states are flown so: what a suite of sensors says has to be looked at one by one.

Source: docs/decisions/0037-quiet-ticks.md.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from fsw.compiled import compilable, compiled, machine_code
from fsw.control.actuator_watch import Watch, at_start, blank, watch
from fsw.control.cascade import Cascade, CascadeMemory, close_loops
from fsw.control.joints import JointMemory
from fsw.control.tracking import Observed
from fsw.estimation.estimator import attitude
from fsw.flight.active_failsafes import all_is_well
from fsw.flight.failsafe import SLOW_US
from fsw.flight.failsafe_evidence import PLAN_STALE_PERIODS
from fsw.flight.plan_exchange import planned_input
from fsw.flight.safety_watch import off_plan_bound
from fsw.flight.state import AIDED, FlightState
from fsw.frozen import replace
from fsw.model.actuator_health import HEALTHY
from fsw.model.nominal import NominalModel, advance, state_of
from fsw.parameters.flight_config import FlightConfig
from fsw.shapes.zones import NO_ZONES, Array
from fsw.signals import (
    ActuatorCommand,
    Mat3,
    Mode,
    PlanInput,
    PredictionState,
    StateEstimate,
    Vec2,
    Vec3,
    Vec4,
)

READINGS: Final = 20
"""Numbers of a frame: position, velocity, quaternion, gyro, accelerometer, joints, their rates."""

_FLOAT = np.float64  # all of them, so that a record is written and read at once
QUIET: Final = np.dtype(
    [
        ("reading", _FLOAT, (READINGS,)),  # SI, the last frame
        # The estimate, beside what the frame holds.
        ("R", _FLOAT, (9,)),
        ("yaw", _FLOAT),  # rad
        # The plan's state, SI as in PredictionState, and its input since the last tick.
        ("nominal", _FLOAT, (19,)),
        ("u", _FLOAT, (6,)),
        # The loops' memory.
        ("rotors", _FLOAT, (4,)),  # N
        ("thrust", _FLOAT, (4,)),  # N, sent
        ("torque", _FLOAT, (2,)),  # N m, sent
        ("observed", _FLOAT, (9,)),  # m/s, m/s^2
        ("mass", _FLOAT),  # kg
        ("attitude", _FLOAT, (3,)),  # rad s
        ("height", _FLOAT),  # m s
        ("joints", _FLOAT, (10,)),  # SI as in JointMemory
        ("off_plan", _FLOAT),  # m
    ],
    align=True,
)
Quiet = NDArray[Any]  # (1,) of QUIET
_NOT_READ: Final = (0.0,) * READINGS


class Bounds(NamedTuple):
    """Between which a tick is quiet."""

    off_plan: float  # m, on each axis
    upright: float  # cosine of the tilt
    tick: float  # s
    decay: float  # of a rotor's error in a tick


@compiled
def _tick(
    law: NDArray[Any],
    model: NDArray[Any],
    airframe: NDArray[Any],
    zones: Array,
    probes: Array,
    bounds: Bounds,
    now_us: int,
    reading: Array,
    before: Quiet,
    after: Quiet,
    watched: Watch,
    watching: Watch,
) -> tuple[bool, Vec4, Vec2]:
    """One tick from ``before`` to ``after``, and from ``watched`` to ``watching``.

    False, and nothing to rely on in either, if something happens. ``reading`` (READINGS,) [SI];
    ``law``, ``model`` and ``airframe`` as cascade, plan's model and watch have them packed,
    ``zones`` (zones, k) [SI] and ``probes`` (probes, 12) [SI] as ``close_loops`` takes them. Also
    the command, rotors [N] and joints [N m]. Zones are where they are at ``now_us``.
    """
    b, a = before[0], after[0]
    no_thrust, no_torque = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0)
    p, v, q, w, f, q_arm, qd_arm = _frame(reading)
    missing, R, yaw = attitude(p, v, q, w, f, q_arm, qd_arm)
    if missing or not R[8] > bounds.upright:
        return False, no_thrust, no_torque
    u = PlanInput(_three(b.u, 0), b.u[3], (b.u[4], b.u[5]))
    plan = advance(model[0], state_of(b.nominal), u, 1)
    most = bounds.off_plan
    for i in range(3):
        if not -most <= p[i] - plan.p[i] <= most:
            return False, no_thrust, no_torque
    sent = ActuatorCommand(_four(b.thrust), (b.torque[0], b.torque[1]))
    memory = CascadeMemory(
        _four(b.rotors),
        sent,
        _observed(b.observed),
        b.mass,
        _three(b.attitude, 0),
        b.height,
        _joints(b.joints),
        b.off_plan,
        HEALTHY,
    )
    estimate = StateEstimate(now_us, p, v, R, w, yaw, q_arm, qd_arm, -f[2])
    command, kept, guarded = close_loops(law[0], memory, estimate, plan, u, 1, zones, probes)
    if guarded[0] or not guarded[1] >= 0.0 or not _within(law[0].airframe, command):
        return False, no_thrust, no_torque
    failed = watch(
        watched,
        watching,
        airframe,
        bounds.decay,
        bounds.tick,
        sent.rotor_thrust,
        sent.joint_torque,
        kept.joints.reference,
        w,
        q_arm,
        qd_arm,
        -f[2],
        True,
    )
    if failed:
        return False, no_thrust, no_torque
    _note_frame(a, reading, R, yaw)
    _note_plan(a, plan, u)
    _note_memory(a, kept, command)
    return True, command.rotor_thrust, command.joint_torque


@compilable
def _frame(x: Any) -> tuple[Vec3, Vec3, Vec4, Vec3, Vec3, Vec2, Vec2]:
    return (
        (x[0], x[1], x[2]),
        (x[3], x[4], x[5]),
        (x[6], x[7], x[8], x[9]),
        (x[10], x[11], x[12]),
        (x[13], x[14], x[15]),
        (x[16], x[17]),
        (x[18], x[19]),
    )


@compilable
def _three(x: Array, k: int) -> Vec3:
    return x[k], x[k + 1], x[k + 2]


@compilable
def _four(x: Array) -> Vec4:
    return x[0], x[1], x[2], x[3]


@compilable
def _observed(x: Any) -> Observed:
    return Observed((x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7]), x[8])


@compilable
def _joints(x: Any) -> JointMemory:
    return JointMemory((x[0], x[1]), (x[2], x[3]), (x[4], x[5]), (x[6], x[7]), (x[8], x[9]))


@compilable
def _within(airframe: Any, command: ActuatorCommand) -> bool:
    """Whether the safety gate has nothing to change."""
    top, most = airframe.rotor_thrust_max, airframe.joint_torque_max
    f, t = command.rotor_thrust, command.joint_torque
    for i in range(4):
        if not 0.0 <= f[i] <= top:
            return False
    return bool(-most <= t[0] <= most and -most <= t[1] <= most)


@compilable
def _note_frame(a: Any, reading: Array, R: Any, yaw: float) -> None:
    for i in range(READINGS):
        a.reading[i] = reading[i]
    for i in range(9):
        a.R[i] = R[i]
    a.yaw = yaw


@compilable
def _note_plan(a: Any, x: PredictionState, u: PlanInput) -> None:
    n = a.nominal
    for i in range(3):
        n[i], n[3 + i], n[6 + i], a.u[i] = x.p[i], x.v[i], x.a[i], u.a[i]
    n[13], n[14], a.u[3] = x.yaw, x.yaw_rate, u.yaw_acc
    for i in range(2):
        n[9 + i], n[11 + i], n[15 + i], n[17 + i] = x.j[i], x.s[i], x.q_arm[i], x.qd_arm[i]
        a.u[4 + i] = u.qdd_arm[i]


@compilable
def _note_memory(a: Any, m: CascadeMemory, command: ActuatorCommand) -> None:
    for i in range(4):
        a.rotors[i], a.thrust[i] = m.rotors[i], command.rotor_thrust[i]
    for i in range(3):
        a.observed[i], a.observed[3 + i] = m.observed.v[i], m.observed.d[i]
        a.attitude[i] = m.attitude[i]
    a.mass, a.height, a.off_plan = m.mass, m.height, m.off_plan
    k = m.joints
    a.observed[8] = m.observed.recent
    for i in range(2):
        a.torque[i] = command.joint_torque[i]
        a.observed[6 + i] = m.observed.disturbance_bias[i]
        a.joints[i], a.joints[2 + i], a.joints[4 + i] = (
            k.reference[i],
            k.momentum[i],
            k.disturbance[i],
        )
        a.joints[6 + i], a.joints[8 + i] = k.integral[i], k.reference_rate[i]


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
        self._laws = (cascade.packed, model.packed, airframe)
        self._probes = cascade.probes
        self._bounds = Bounds(radius, upright, 1e-6 * self._tick_us, decay)
        self._before, self._after = np.zeros(1, QUIET), np.zeros(1, QUIET)
        self._watched, self._watching = at_start(), blank()
        self._zones = NO_ZONES
        self._flown, self._since_us = 0, 0
        example = (self._bounds, 0, np.zeros(READINGS), self._before, self._after)
        self._code: Callable[..., tuple[bool, Vec4, Vec2]] = machine_code(
            _tick, *self._laws, NO_ZONES, self._probes, *example, self._watched, self._watching
        )

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
        _take(self._before, state, x, nominal, u)
        self._watched = at_start() if state.watch is None else state.watch
        self._watching = blank()
        return ticks

    def tick(self, reading: Array) -> tuple[bool, Vec4, Vec2]:
        """One tick with a ``reading`` (READINGS,) [SI]: whether it was quiet, and its command.

        Rotors [N] and joints [N m]. If it was not, the tick is still to be flown.
        """
        quiet, thrust, torque = self._code(
            *self._laws,
            self._zones,
            self._probes,
            self._bounds,
            self._since_us + (self._flown + 1) * self._tick_us,
            reading,
            self._before,
            self._after,
            self._watched,
            self._watching,
        )
        if quiet:
            self._flown += 1
            self._before, self._after = self._after, self._before
            # The first one is the state's own.
            given = self._watched if self._flown > 1 else blank()
            self._watched, self._watching = self._watching, given
        return quiet, thrust, torque

    def end(self, state: FlightState) -> FlightState:
        """The state after all quiet ticks that followed on a ``state``."""
        if not self._flown:
            return state
        t_us = state.t_us + self._flown * self._tick_us
        numbers = _Numbers(self._before)
        p, v, _, w, f, q_arm, qd_arm = _frame(numbers.take(READINGS))
        R = cast(Mat3, tuple(numbers.take(9)))
        (yaw,) = numbers.take(1)
        nominal = state_of(numbers.take(19))
        numbers.take(6)  # the plan still has its input
        return replace(
            state,
            index=state.index + self._flown,
            t_us=t_us,
            estimate=StateEstimate(t_us, p, v, R, w, yaw, q_arm, qd_arm, -f[2]),
            nominal=nominal,
            cascade=_memory(numbers, state.cascade),
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
        and not vehicle.conditions
        and state.fusion is None
        and state.nominal is not None
        and estimate is not None
        and estimate.t_us == state.t_us
        and state.index >= 0
        and state.invalid_ticks == 0
        and not state.tuning
        and state.aiding is AIDED
        and not (state.damage.rotor or state.damage.joint)
        and state.damage.health is state.cascade.health is HEALTHY
        and bool(config.limits.watches_actuators)
        and bool(state.mission.stream)
        and plan.running is not None
        and state.t_us >= plan.since_us
        and all_is_well(state, estimate, config)
    )


def _take(
    into: Quiet, state: FlightState, x: StateEstimate, n: PredictionState, u: PlanInput
) -> None:
    """Write a state down as a quiet tick has it, in the order of ``QUIET``."""
    m = state.cascade
    thrust, torque = m.commanded
    into.view(np.float64)[:] = (
        *(*_NOT_READ, *x.R_WB, x.yaw),
        *(*n.p, *n.v, *n.a, *n.j, *n.s, n.yaw, n.yaw_rate, *n.q_arm, *n.qd_arm),
        *(*u.a, u.yaw_acc, *u.qdd_arm),
        *(*m.rotors, *thrust, *torque),
        *(*m.observed.v, *m.observed.d, *m.observed.disturbance_bias, m.observed.recent),
        *(m.mass, *m.attitude, m.height),
        *[value for pair in m.joints for value in pair],
        m.off_plan,
    )


class _Numbers:
    """Those of a record, one field after the other."""

    def __init__(self, record: Quiet) -> None:
        self._numbers: list[float] = record.view(np.float64).tolist()
        self._at = 0

    def take(self, count: int) -> list[float]:
        """The next ones."""
        begin, self._at = self._at, self._at + count
        return self._numbers[begin : self._at]


def _memory(numbers: _Numbers, before: CascadeMemory) -> CascadeMemory:
    f1, f2, f3, f4 = numbers.take(4)
    sent1, sent2, sent3, sent4 = numbers.take(4)
    t1, t2 = numbers.take(2)
    observed = _observed(numbers.take(9))
    (mass,), (x, y, z), (height,) = numbers.take(1), numbers.take(3), numbers.take(1)
    joints = _joints(numbers.take(10))
    (off_plan,) = numbers.take(1)
    return CascadeMemory(
        (f1, f2, f3, f4),
        ActuatorCommand((sent1, sent2, sent3, sent4), (t1, t2)),
        observed,
        mass,
        (x, y, z),
        height,
        joints,
        off_plan,
        before.health,
    )
