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
from sitl.plant.bodies import posture_into
from sitl.plant.gears import move_free, part_teeth, servo_rates_into
from sitl.plant.kinematics import place_into, touch_down_speed
from sitl.plant.mass_matrix import mass_matrix_into, solve_in_place
from sitl.plant.state import ARM, Q_WB, V_WB, W_WB_B
from sitl.plant.vector import V3, V4, Array, add, put, rotation_into, sub, times, triple

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


@kernel
def geared_step(
    plant: Plant,
    state: Array,
    inputs: Inputs,
    step: float,
    work: Workspace,
    slopes: Slopes,
    moved: Array,
) -> None:
    """``rk4_step`` of ``step`` [s] with the gaps of the gears; ``moved`` (j,) [rad] is memory.

    The ``state`` (17 + 2j,) [SI] is advanced in place.
    """
    joints = moved.shape[0]
    acceleration_into(plant, state, inputs, work)
    part_teeth(plant.gears, inputs.torque, work.load, state[ARM + joints :])
    for i in range(joints):
        moved[i] = -state[ARM + i]
    rk4_step(plant, state, inputs, step, work, slopes)
    for i in range(joints):
        moved[i] += state[ARM + i]
    if move_free(plant.gears, inputs.torque, moved, state[ARM + joints :], step):
        strike(plant, state, moved, work)


@kernel
def strike(plant: Plant, state: Array, momentum: Array, work: Workspace) -> None:
    """Let motors strike joints with a ``momentum`` (j,) [N·m·s]; state (17 + 2j,) [SI]."""
    joints = momentum.shape[0]
    rotation_into(state, Q_WB, work.rotation)
    posture_into(plant.chain, state[ARM : ARM + joints], work.posture)
    mass_matrix_into(plant.chain, work.posture, work.mass)
    for i in range(6):
        work.load[i] = 0.0
    for i in range(joints):
        work.mass[6 + i, 6 + i] += plant.gears.carried[i]
        work.load[6 + i] = momentum[i]
    solve_in_place(work.mass, work.load)
    put(state, V_WB, add(triple(state, V_WB), times(work.rotation, triple(work.load, 0))))
    put(state, W_WB_B, add(triple(state, W_WB_B), triple(work.load, 3)))
    for i in range(joints):
        state[ARM + joints + i] += work.load[6 + i]


@compiled
def integrate(
    plant: Plant, state: Array, inputs: Inputs, step: float, places: Array, states: Array
) -> Arrival:
    """Advance ``state`` (17 + 2j,) [SI] in place by one ``step`` [s] per row of ``places``.

    One call does all that an exchange needs, because handing the plant's arrays to compiled code
    costs as much as two steps. The inputs are held over all steps.

    Base origin and origin of every DH frame go to places (steps, 2 + j, 3) [m, NED], after each
    step, and the state itself to ``states`` (steps, 17 + 2j) [SI], but with the rates of the
    joints' servos, which limits are about; without rows the state stays as it is.
    """
    n = state.shape[0]
    work = empty_workspace((n - ARM) // 2)
    slopes = Slopes(np.empty(n), np.empty(n), np.empty(n))
    moved = np.empty((n - ARM) // 2)
    fastest = 0.0
    for k in range(places.shape[0]):
        loose = plant.gears.gap > 0.0
        if loose:
            geared_step(plant, state, inputs, step, work, slopes, moved)
        else:
            rk4_step(plant, state, inputs, step, work, slopes)
        place_into(plant, state, work, k, places)
        states[k] = state
        if loose:
            servo_rates_into(plant.gears, states[k, n - len(moved) :])
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
