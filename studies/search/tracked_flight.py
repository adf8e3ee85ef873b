"""A stretch of a recorded plan, flown by plant and fast loops alone, in one compiled call.

Eleven microseconds a tick, a hundredth of what the whole stack takes. The disturbance is a table of
values or an adversary that sees, on each axis, how far and how fast the vehicle is off its plan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numba
import numpy as np
from numpy.typing import NDArray

from fsw.compiled import compilable, packed
from fsw.control.cascade import Cascade, CascadeLaw, CascadeMemory, close_loops
from fsw.estimation.estimator import attitude
from fsw.flight.autopilot import keep_clear
from fsw.model.nominal import state_of
from fsw.model.prediction import Array
from fsw.parameters.flight_config import FlightConfig
from fsw.signals import ActuatorCommand, PlanInput, StateEstimate
from sitl.body import Parts
from sitl.mission_clock import MissionClock
from sitl.plant.aerial_manipulator import Inputs, Plant, plant
from sitl.plant.integrator import STEP_S, Held, held, integrate
from sitl.plant.parameters import GRAVITY
from sitl.scenario import Scenario
from sitl.simulation import START_US, STEP_US, SUBSTEPS
from sitl.start import flown_vehicle
from sitl.trajectory import place_on_curve
from sitl.world import Headroom, World, ZoneTable, fill_margins, headroom, record_if_clear
from studies.search.plan_record import PlanRecord, Start

# A row of what is kept: deviation and disturbance, each (3,), and whether the safety filter acted.
OFF, PUSH, FILTERED, KEPT = 0, 3, 6, 7
_NO_CURVE = np.empty(0)
FEATURES = 3  # position, velocity, acceleration off the plan


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Within ±``amplitude`` on each axis, held for ``every`` ticks.

    Either a table of values from -1 to 1, or the sign of a weighted sum of what an axis is off its
    plan by: position, velocity and acceleration. An axis with weights of 0 is left alone.
    """

    amplitude: float  # m/s²
    every: int  # ticks
    table: Array  # (n, 3), or (0, 3) for an adversary
    weights: Array  # (3, FEATURES)


class TrackedFlight:
    """Flies stretches of one record."""

    def __init__(self, scenario: Scenario, config: FlightConfig, flown: PlanRecord) -> None:
        tick = config.tick_period_us * 1e-6
        cascade = Cascade(config.airframe, config.tuning, config.inner, tick, keep_clear(config))
        self._law = np.asarray(packed(cascade.law))
        self._probes = cascade.probes
        self._plants = np.array([plant(flown_vehicle(scenario))])
        self._record = flown
        self._world, clock = World(scenario), MissionClock(scenario)
        assert clock.starts_s is not None  # it starts in the air
        self._aim = (clock.curve if self._world.follows else _NO_CURVE, clock.starts_s)
        self._axes = 3 if scenario.body == "full" else 0

    def fly(self, start: Start, ticks: int, disturbance: Disturbance) -> tuple[Array, float]:
        """What is kept of each tick, (ticks, KEPT) [SI], and the smallest margin [m].

        Fewer ticks where the flight diverged; an infinite margin without zones.
        """
        rows = self._record.rows[start.row : start.row + ticks + 1]
        kept = np.zeros((len(rows) - 1, KEPT))
        places = np.empty((SUBSTEPS, 4 + self._axes, 3))
        lowest = np.full(len(self._world.keys), np.inf)
        flown = _track(
            self._plants,
            self._law,
            self._probes,
            start.state.copy(),
            start.memory,
            rows,
            self._record.zones,
            self._record.spans[start.row :],
            start.step,
            disturbance.amplitude,
            disturbance.every,
            disturbance.table,
            disturbance.weights,
            kept,
            self._world.table,
            self._world.parts,
            self._aim,
            places,
            lowest,
            headroom(self._world.table, len(lowest), places.shape[1]),
            held(2),
        )
        return kept[:flown], float(lowest.min(initial=np.inf))


def _compiled(function: Callable[..., int]) -> Callable[..., int]:
    # Not cached: the caches of both halves know their own sources only.
    return cast(Callable[..., int], numba.njit(error_model="numpy", nogil=True)(function))


@_compiled
def _track(
    plants: NDArray[Any],
    laws: NDArray[Any],
    probes: Array,
    x: Array,
    memory: CascadeMemory,
    rows: Array,
    zones: Array,
    spans: NDArray[np.int64],
    first_step: int,
    amplitude: float,
    every: int,
    table: Array,
    weights: Array,
    kept: Array,
    table_of_zones: ZoneTable,
    parts: Parts,
    aim: tuple[Array, float],
    places: Array,
    lowest: Array,
    room: Headroom,
    blocks: Sequence[Held],
) -> int:
    law: CascadeLaw = laws[0]
    body: Plant = plants[0]
    mass = body.chain.mass.sum()
    states = np.empty((SUBSTEPS, x.shape[0]))
    margins, when_s = np.empty(lowest.shape[0]), np.zeros(lowest.shape[0])
    push = np.zeros(3)
    felt = (0.0, 0.0, -GRAVITY)
    top, drive = law.airframe.rotor_thrust_max, law.airframe.joint_torque_max
    for k in range(kept.shape[0]):
        r, ahead = rows[k], rows[k + 1]
        nominal = state_of(r)
        u = PlanInput((r[19], r[20], r[21]), r[22], (r[23], r[24]))
        p, v, w = (x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[10], x[11], x[12])
        q_arm, qd_arm = (x[17], x[18]), (x[19], x[20])
        _, R, yaw = attitude(p, v, (x[6], x[7], x[8], x[9]), w, felt, q_arm, qd_arm)
        step = first_step + k
        estimate = StateEstimate(
            START_US + STEP_US * step, p, v, R, w, yaw, q_arm, qd_arm, -felt[2]
        )
        near = zones[spans[k, 0] : spans[k, 1]]
        command, memory, guarded = close_loops(law, memory, estimate, nominal, u, 1, near, probes)
        f, t = command.rotor_thrust, command.joint_torque
        sent = ActuatorCommand(
            (
                min(max(f[0], 0.0), top),
                min(max(f[1], 0.0), top),
                min(max(f[2], 0.0), top),
                min(max(f[3], 0.0), top),
            ),
            (min(max(t[0], -drive), drive), min(max(t[1], -drive), drive)),
        )
        memory = CascadeMemory(
            memory.rotors,
            sent,
            memory.observed,
            memory.mass,
            memory.attitude,
            memory.height,
            memory.joints,
            memory.off_plan,
            memory.health,
        )
        if k % every == 0:
            lift = (x[13] + x[14] + x[15] + x[16]) / mass
            a = (-lift * R[2], -lift * R[5], GRAVITY - lift * R[8])
            for axis in range(3):
                if table.shape[0] > 0:
                    push[axis] = amplitude * table[min(k // every, table.shape[0] - 1), axis]
                else:
                    chased = (
                        weights[axis, 0] * (p[axis] - r[axis])
                        + weights[axis, 1] * (v[axis] - r[3 + axis])
                        + weights[axis, 2] * (a[axis] - r[6 + axis])
                    )
                    idle = not weights[axis].any()
                    push[axis] = 0.0 if idle else amplitude * (1.0 if chased >= 0.0 else -1.0)
        inputs = Inputs(
            np.array(sent.rotor_thrust), np.array(sent.joint_torque), mass * push, np.zeros(3)
        )
        felt = integrate(body, x, inputs, STEP_S, places, states, blocks).felt
        before_s = 1e-6 * STEP_US * step
        _judge(table_of_zones, parts, aim, places, before_s, lowest, when_s, margins, room)
        for axis in range(3):
            kept[k, OFF + axis] = x[axis] - ahead[axis]
            kept[k, PUSH + axis] = push[axis]
        kept[k, FILTERED] = 1.0 if guarded[0] else 0.0
        if not (abs(kept[k, OFF]) + abs(kept[k, OFF + 1]) + abs(kept[k, OFF + 2]) < 10.0):
            return k + 1
    return len(kept)


@compilable
def _judge(
    table: ZoneTable,
    parts: Parts,
    aim: tuple[Array, float],
    places: Array,
    before_s: float,
    lowest: Array,
    when_s: Array,
    margins: Array,
    room: Headroom,
) -> None:
    """Take the margins of a tick into the lowest, as the simulator's judge does."""
    instants = (before_s, STEP_S)
    if record_if_clear(table, parts, aim, places, instants, lowest, when_s, room) >= 0.0:
        return
    curve, starts_s = aim
    for k in range(places.shape[0]):
        time_s = before_s + (k + 1) * STEP_S
        target = (0.0, 0.0, 0.0)
        if curve.shape[0]:
            target = place_on_curve(curve, time_s - starts_s)
        fill_margins(table, parts, places[k], time_s, target, margins)
        for i in range(lowest.shape[0]):
            # A margin that is no number is of a flight that diverged.
            lowest[i] = min(lowest[i], margins[i]) if margins[i] == margins[i] else -np.inf
