"""A stretch of a recorded plan, flown by plant and fast loops alone, in one compiled call.

Eleven microseconds a tick, a hundredth of what the whole stack takes. The disturbance is a table of
values or an adversary that sees, on each axis, how far and how fast the vehicle is off its plan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numba
import numpy as np
from numpy.typing import NDArray

from fsw.compiled import packed
from fsw.control.cascade import Cascade, CascadeLaw, CascadeMemory, close_loops
from fsw.estimation.estimator import attitude
from fsw.model.prediction import Array
from fsw.parameters.flight_config import FlightConfig
from fsw.signals import ActuatorCommand, PlanInput, PredictionState, StateEstimate
from sitl.plant.aerial_manipulator import Inputs, Plant, plant
from sitl.plant.integrator import STEP_S, integrate
from sitl.plant.parameters import GRAVITY
from sitl.scenario import Scenario
from sitl.simulation import SUBSTEPS
from sitl.start import flown_vehicle
from studies.plan_record import PlanRecord, Start

# A row of what is kept: deviation, disturbance, base, joint 2 and end-effector, each (3,).
OFF, PUSH, BASE, JOINT2, TIP, KEPT = 0, 3, 6, 9, 12, 15
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
        cascade = Cascade(config.airframe, config.tuning, config.inner, tick)
        self._law = np.asarray(packed(cascade.law))
        self._plants = np.array([plant(flown_vehicle(scenario))])
        self._record = flown

    def fly(self, start: Start, ticks: int, disturbance: Disturbance) -> Array:
        """What is kept of each tick, (ticks, KEPT) [SI]; shorter where the flight diverged."""
        rows = self._record.rows[start.row : start.row + ticks + 1]
        kept = np.zeros((len(rows) - 1, KEPT))
        flown = _track(
            self._plants,
            self._law,
            start.state.copy(),
            start.memory,
            rows,
            disturbance.amplitude,
            disturbance.every,
            disturbance.table,
            disturbance.weights,
            kept,
        )
        return kept[:flown]


def _compiled(function: Callable[..., int]) -> Callable[..., int]:
    # Not cached: the caches of both halves know their own sources only.
    return cast(Callable[..., int], numba.njit(error_model="numpy", nogil=True)(function))


@_compiled
def _track(
    plants: NDArray[Any],
    laws: NDArray[Any],
    x: Array,
    memory: CascadeMemory,
    rows: Array,
    amplitude: float,
    every: int,
    table: Array,
    weights: Array,
    kept: Array,
) -> int:
    law: CascadeLaw = laws[0]
    body: Plant = plants[0]
    mass = body.chain.mass.sum()
    places = np.empty((SUBSTEPS, 4, 3))
    push = np.zeros(3)
    felt = (0.0, 0.0, -GRAVITY)
    top, drive = law.airframe.rotor_thrust_max, law.airframe.joint_torque_max
    for k in range(kept.shape[0]):
        r, ahead = rows[k], rows[k + 1]
        nominal = PredictionState(
            (r[0], r[1], r[2]),
            (r[3], r[4], r[5]),
            (r[6], r[7], r[8]),
            (r[9], r[10]),
            (r[11], r[12]),
            r[13],
            r[14],
            (r[15], r[16]),
            (r[17], r[18]),
        )
        u = PlanInput((r[19], r[20], r[21]), r[22], (r[23], r[24]))
        p, v, w = (x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[10], x[11], x[12])
        q_arm, qd_arm = (x[17], x[18]), (x[19], x[20])
        _, R, yaw = attitude(p, v, (x[6], x[7], x[8], x[9]), w, felt, q_arm, qd_arm)
        estimate = StateEstimate(0, p, v, R, w, yaw, q_arm, qd_arm, -felt[2])
        command, memory = close_loops(law, memory, estimate, nominal, u, 1)
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
        felt = integrate(body, x, inputs, STEP_S, places).felt
        for axis in range(3):
            kept[k, OFF + axis] = x[axis] - ahead[axis]
            kept[k, PUSH + axis] = push[axis]
            kept[k, BASE + axis] = places[SUBSTEPS - 1, 0, axis]
            kept[k, JOINT2 + axis] = places[SUBSTEPS - 1, 2, axis]
            kept[k, TIP + axis] = places[SUBSTEPS - 1, 3, axis]
        if not (abs(kept[k, OFF]) + abs(kept[k, OFF + 1]) + abs(kept[k, OFF + 2]) < 10.0):
            return k + 1
    return len(kept)
