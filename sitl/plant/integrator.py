"""Fixed-step Runge–Kutta 4 over the plant, in one compiled call."""

from __future__ import annotations

import numpy as np

from sitl.compiled import compiled
from sitl.plant.aerial_manipulator import (
    Inputs,
    Plant,
    acceleration_into,
    derivative_into,
    empty_workspace,
)
from sitl.plant.newton_euler import gravity_in_body
from sitl.plant.state import JOINTS_FROM, Q_WB
from sitl.plant.vector import V3, Array, row, sub

STEP_S = 0.001  # 6e-7 error after 2 s of free motion; at 4 ms it would be 7e-4


@compiled
def integrate(plant: Plant, state: Array, inputs: Inputs, step: float, trace: Array) -> None:
    """Advance ``state`` in place by one step per row of ``trace``, which keeps each new state.

    Args:
        plant: Numbers of the vehicle.
        state: (17 + 2j,), see ``sitl.plant.state``.
        inputs: Commands and disturbance, held over all steps.
        step: Length of one step [s].
        trace: (steps, 17 + 2j), overwritten.
    """
    n = state.shape[0]
    work = empty_workspace((n - JOINTS_FROM) // 2)
    slope, total, middle = np.empty(n), np.empty(n), np.empty(n)
    for k in range(trace.shape[0]):
        derivative_into(plant, state, inputs, work, total)
        for i in range(n):
            middle[i] = state[i] + 0.5 * step * total[i]
        derivative_into(plant, middle, inputs, work, slope)
        for i in range(n):
            total[i] += 2.0 * slope[i]
            middle[i] = state[i] + 0.5 * step * slope[i]
        derivative_into(plant, middle, inputs, work, slope)
        for i in range(n):
            total[i] += 2.0 * slope[i]
            middle[i] = state[i] + step * slope[i]
        derivative_into(plant, middle, inputs, work, slope)
        for i in range(n):
            state[i] += step / 6.0 * (total[i] + slope[i])
        q = state[Q_WB]
        length = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for i in range(4):
            q[i] /= length
        trace[k] = state


@compiled
def specific_force(plant: Plant, state: Array, inputs: Inputs) -> V3:
    """What an accelerometer at the base origin feels [m/s², B]: acceleration minus gravity."""
    work = empty_workspace((state.shape[0] - JOINTS_FROM) // 2)
    acceleration_into(plant, state, inputs, work)
    return sub(row(work.load), gravity_in_body(work.rotation, plant.gravity))
