"""Fixed-step Runge–Kutta 4 over the plant, in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sitl.compiled import compiled, kernel
from sitl.plant.aerial_manipulator import (
    Inputs,
    Plant,
    Workspace,
    acceleration_into,
    derivative_into,
    empty_workspace,
    gravity_in_body,
)
from sitl.plant.kinematics import place_into, touch_down_speed
from sitl.plant.state import ARM, Q_WB
from sitl.plant.vector import V3, V4, Array, sub, triple

STEP_S = 0.001  # 1e-9 error after a second of tumbling (tests/sitl/test_conservation.py)


class Slopes(NamedTuple):
    """Memory of one Runge–Kutta step, each (17 + 2j,)."""

    one: Array
    total: Array
    middle: Array


class Arrival(NamedTuple):
    """What a run of steps ended with, besides the state."""

    landing_speed: float  # m/s, fastest downward speed of a foot on the ground after any step
    felt: V3  # m/s², specific force at the base origin in the last state, B


@kernel
def specific_force(plant: Plant, state: Array, inputs: Inputs, work: Workspace) -> V3:
    """Acceleration minus gravity at the base origin [m/s², B] in a state (17 + 2j,) [SI]."""
    acceleration_into(plant, state, inputs, work)
    return sub(triple(work.load, 0), gravity_in_body(work.rotation, plant.gravity))


@kernel
def rk4_step(
    plant: Plant, state: Array, inputs: Inputs, step: float, work: Workspace, slopes: Slopes
) -> None:
    """Advance a state (17 + 2j,) [SI] in place by ``step`` [s]; the attitude gets unit length."""
    n = state.shape[0]
    one, total, middle = slopes.one, slopes.total, slopes.middle
    derivative_into(plant, state, inputs, work, total)
    for i in range(n):
        middle[i] = state[i] + 0.5 * step * total[i]
    derivative_into(plant, middle, inputs, work, one)
    for i in range(n):
        total[i] += 2.0 * one[i]
        middle[i] = state[i] + 0.5 * step * one[i]
    derivative_into(plant, middle, inputs, work, one)
    for i in range(n):
        total[i] += 2.0 * one[i]
        middle[i] = state[i] + step * one[i]
    derivative_into(plant, middle, inputs, work, one)
    for i in range(n):
        state[i] += step / 6.0 * (total[i] + one[i])
    length = 0.0
    for i in range(Q_WB, Q_WB + 4):
        length += state[i] * state[i]
    for i in range(Q_WB, Q_WB + 4):
        state[i] /= np.sqrt(length)


@compiled
def integrate(
    plant: Plant, state: Array, inputs: Inputs, step: float, places: Array, states: Array
) -> Arrival:
    """Advance ``state`` (17 + 2j,) [SI] in place by one ``step`` [s] per row of ``places``.

    One call does all that an exchange needs, because handing the plant's arrays to compiled code
    costs as much as two steps. The inputs are held over all steps.

    Base origin and origin of every DH frame go to places (steps, 2 + j, 3) [m, NED], after each
    step, and the state itself to ``states`` (steps, 17 + 2j) [SI]; without rows the state stays as
    it is.
    """
    n = state.shape[0]
    work = empty_workspace((n - ARM) // 2)
    slopes = Slopes(np.empty(n), np.empty(n), np.empty(n))
    fastest = 0.0
    for k in range(places.shape[0]):
        rk4_step(plant, state, inputs, step, work, slopes)
        place_into(plant, state, work, k, places)
        states[k] = state
        fastest = max(fastest, touch_down_speed(plant, state, work))
    return Arrival(fastest, specific_force(plant, state, inputs, work))


@compiled
def step(
    plants: Sequence[Plant],
    state: Array,
    thrust: V4,
    torque: tuple[float, ...],
    force_W: V3,
    torque_B: V3,
    step_s: float,
    places: Array,
    states: Array,
) -> Arrival:
    """``integrate`` with the plant in an array of one and inputs in tuples: the cheapest to call.

    ``thrust`` [N] and ``torque`` [N·m] are commanded, rotors 1 to 4 and joints;
    ``force_W`` [N, NED] and ``torque_B`` [N·m, B] disturb the base.

    Overwritten are state (17 + 2j,) [SI], places (steps, 2 + j, 3) [m, NED] and ``states``
    (steps, 17 + 2j) [SI].
    """
    inputs = Inputs(np.array(thrust), np.array(torque), np.array(force_W), np.array(torque_B))
    return integrate(plants[0], state, inputs, step_s, places, states)
