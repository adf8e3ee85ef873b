"""A stretch of a recorded plan, flown by plant and fast loops alone, in one compiled call.

Eleven microseconds a tick, a hundredth of what the whole stack takes. The disturbance is a table of
values or an adversary that sees, on each axis, how far and how fast the vehicle is off its plan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numba
import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.control.cascade import CascadeLaw, close_loops
from fsw.autopilot.control.safety_filter import FilterProbes
from fsw.autopilot.estimation.estimator import READINGS, read_into
from fsw.autopilot.flight.fast_loop import loops_of
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.tick_record import FILTER_ACTED, Tick
from fsw.compiled import compilable, packed
from sitl.body import Parts
from sitl.mission_clock import MissionClock
from sitl.plant.aerial_manipulator import Inputs, Plant
from sitl.plant.integrator import STEP_S, Held, held, integrate
from sitl.plant.parameters import GRAVITY, plant
from sitl.plant.state import JOINTS_MAX, ROTORS_MAX, THRUST
from sitl.scenario import Scenario
from sitl.simulation import START_US, STEP_US, SUBSTEPS, Simulation
from sitl.start import effects, flown_vehicle
from sitl.touch import touched_zones
from sitl.trajectory import place_on_curve
from sitl.world import Headroom, World, ZoneTable, fill_margins, headroom, record_if_clear
from studies.search.plan_record import PlanRecord, Start
from studies.search.surfaces import Met, met_by

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
    met: Met | None = None  # by the tool; None: what the scenario says


class Stretch(NamedTuple):
    """What a stretch was like."""

    kept: Array  # (ticks, KEPT) [SI]; fewer ticks where the flight diverged
    margin_m: float  # smallest; infinite without zones
    force_share: float  # largest normal force on the tool over what its surface allows [1]


class TrackedFlight:
    """Flies stretches of one record."""

    def __init__(self, scenario: Scenario, config: FlightConfig, flown: PlanRecord) -> None:
        cascade = loops_of(config)
        self._law = np.asarray(packed(cascade.law))
        self._probes = cascade.probes
        self._scenario = scenario
        self._plants: dict[Met | None, NDArray[Any]] = {}
        self._forces = [one.table.touch.force_max_n for one in touched_zones(scenario)
                        if one.table.touch is not None]  # fmt: skip
        self._record = flown
        self._world, clock = World(scenario), MissionClock(scenario)
        assert clock.starts_s is not None  # it starts in the air
        self._aim = (clock.curve if self._world.follows else _NO_CURVE, clock.starts_s)
        self._rows = len(Simulation(scenario, 0).places())

    def _meeting(self, met: Met | None) -> NDArray[Any]:
        """The plant where the tool meets this, as before any contact."""
        if met not in self._plants:
            scenario = self._scenario if met is None else met_by(self._scenario, met)
            self._plants[met] = np.array([plant(flown_vehicle(scenario), effects(scenario))])
        return self._plants[met].copy()

    def fly(self, start: Start, ticks: int, disturbance: Disturbance) -> Stretch:
        """Fly ``ticks`` from a start."""
        plants = self._meeting(disturbance.met)
        states = self._record.states[start.row : start.row + ticks + 1]
        kept = np.zeros((len(states) - 1, KEPT))
        places = np.empty((SUBSTEPS, self._rows, 3))
        lowest = np.full(len(self._world.keys), np.inf)
        flown = _track(
            plants,
            self._law,
            self._probes,
            start.state.copy(),
            start.memory.copy().array,
            states,
            self._record.inputs[start.row :],
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
            held(),
        )
        pressed = plants["surfaces"]["force_max"][0]
        shares = [float(most) / bound for most, bound in zip(pressed, self._forces, strict=False)]
        return Stretch(kept[:flown], float(lowest.min(initial=np.inf)), max(shares, default=0.0))


def _compiled(function: Callable[..., int]) -> Callable[..., int]:
    # Not cached: the caches of both halves know their own sources only.
    return cast(Callable[..., int], numba.njit(error_model="numpy", nogil=True)(function))


@_compiled
def _track(
    plants: NDArray[Any],
    laws: NDArray[Any],
    probes: FilterProbes,
    x: Array,
    ticks: NDArray[Any],
    plans: NDArray[Any],
    planned_inputs: NDArray[Any],
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
    reading = np.zeros(READINGS)
    reading[6], reading[15] = 1.0, -GRAVITY
    r: Tick = ticks[0]
    rotors, joints = int(law.airframe.rotors), int(law.airframe.bodies.joints)
    angles = THRUST + rotors
    at, rates_at = THRUST + 3, THRUST + 3 + JOINTS_MAX
    top, drive = law.airframe.rotor_thrust_max, law.airframe.joint_torque_max
    thrust, torque = np.zeros(ROTORS_MAX), np.zeros(JOINTS_MAX)
    for k in range(kept.shape[0]):
        planned, ahead = plans[k], plans[k + 1]
        r.plan, r.u = planned, planned_inputs[k]
        reading[:THRUST] = x[:THRUST]
        reading[at : at + joints] = x[angles : angles + joints]
        reading[rates_at : rates_at + joints] = x[angles + joints :]
        step = first_step + k
        read_into(r.estimate, reading, START_US + STEP_US * step)
        close_loops(r, law, 1, zones[spans[k, 0] : spans[k, 1]], probes)
        for i in range(rotors):
            thrust[i] = r.sent.rotor_thrust[i] = min(max(r.sent.rotor_thrust[i], 0.0), top[i])
        for i in range(joints):
            most = drive[i]
            torque[i] = r.sent.joint_torque[i] = min(max(r.sent.joint_torque[i], -most), most)
        if k % every == 0:
            lift = x[THRUST:angles].sum() / mass
            R = r.estimate.R_WB
            a = (-lift * R[2], -lift * R[5], GRAVITY - lift * R[8])
            for axis in range(3):
                if table.shape[0] > 0:
                    push[axis] = amplitude * table[min(k // every, table.shape[0] - 1), axis]
                else:
                    chased = (
                        weights[axis, 0] * (x[axis] - planned.p[axis])
                        + weights[axis, 1] * (x[3 + axis] - planned.v[axis])
                        + weights[axis, 2] * (a[axis] - planned.a[axis])
                    )
                    idle = not weights[axis].any()
                    push[axis] = 0.0 if idle else amplitude * (1.0 if chased >= 0.0 else -1.0)
        inputs = Inputs(thrust, torque, mass * push, np.zeros(3))
        felt = integrate(body, x, inputs, STEP_S, places, states, blocks).felt
        reading[13], reading[14], reading[15] = felt[0], felt[1], felt[2]
        before_s = 1e-6 * STEP_US * step
        _judge(table_of_zones, parts, aim, places, before_s, lowest, when_s, margins, room)
        for axis in range(3):
            kept[k, OFF + axis] = x[axis] - ahead.p[axis]
            kept[k, PUSH + axis] = push[axis]
        kept[k, FILTERED] = 1.0 if r.flags & FILTER_ACTED else 0.0
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
