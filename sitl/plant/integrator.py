"""Fixed-step Runge–Kutta 4 over the plant, in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np

from sitl.compiled import compilable, kernel
from sitl.plant.aerial_manipulator import (
    Inputs,
    Plant,
    Workspace,
    derivative_into,
    empty_workspace,
    first_angle,
    gravity_in_body,
    place_bodies,
    placed_acceleration_into,
)
from sitl.plant.contact import pass_stage, steps_within
from sitl.plant.gears import move_free, part_teeth, servo_rates_into
from sitl.plant.kinematics import places_of_bodies, touch_down_speed
from sitl.plant.mass_matrix import mass_matrix_into, solve_in_place
from sitl.plant.packing import pack_params
from sitl.plant.state import JOINTS_MAX, P_WB, Q_WB, ROTORS_MAX, STATE_MAX, V_WB, W_WB_B
from sitl.plant.vector import V3, V6, V8, Array, add, put, sub, times, triple

STEP_S = 0.001  # 1e-9 error after a second of tumbling (tests/sitl/test_conservation.py)


class Slopes(NamedTuple):
    """Memory of one Runge–Kutta step, each (33,)."""

    one: Array
    total: Array
    middle: Array


class Memory(NamedTuple):
    """All that a run of steps writes beside its results."""

    work: Workspace
    slopes: Slopes
    moved: Array  # (6,)
    now: Array  # (33,), the state: in here, as all else, one type serves every kernel


class Arrival(NamedTuple):
    """What a run of steps ended with, besides the state."""

    landing_speed: float  # m/s, fastest downward speed of a foot on the ground after any step
    felt: V3  # m/s², specific force at the base origin in the last state, B


@kernel
def specific_force(plant: Plant, state: Array, inputs: Inputs, work: Workspace) -> V3:
    """Acceleration minus gravity at the base origin [m/s², B] in a state (n,) [SI].

    ``work`` has placed the bodies.
    """
    placed_acceleration_into(plant, state, inputs, work)
    return sub(triple(work.load, 0), gravity_in_body(work.rotation, plant.gravity))


@compilable
def state_size(plant: Plant) -> int:
    """Entries that the state vector of the vehicle has."""
    return first_angle(plant) + 2 * int(plant.chain.joints)


@compilable
def rk4_step(
    plant: Plant, state: Array, inputs: Inputs, step: float, work: Workspace, slopes: Slopes
) -> None:
    """Advance a state (n,) [SI] in place by ``step`` [s]; the attitude gets unit length.

    ``work`` has placed the bodies of the state before.
    """
    n = state_size(plant)
    one, total, middle = slopes.one, slopes.total, slopes.middle
    for i in range(n):
        middle[i] = state[i]
    surfaces = plant.surfaces
    begun = surfaces.clock[1]
    for stage in range(4):
        if stage > 0:
            place_bodies(plant, middle, work)
        derivative_into(plant, middle, inputs, work, one)
        ahead = step if stage == 2 else 0.5 * step
        if surfaces.number > 0:
            pass_stage(surfaces, stage, step, begun + (ahead if stage < 3 else step))
        for i in range(n):
            if stage == 0:
                total[i] = one[i]
            elif stage < 3:
                total[i] += 2.0 * one[i]
            else:
                total[i] += one[i]
            middle[i] = state[i] + ahead * one[i]
    for i in range(n):
        state[i] += step / 6.0 * total[i]
    normalise_attitude(state)


@compilable
def normalise_attitude(state: Array) -> None:
    """Give the attitude in a state (n,) [SI] unit length."""
    length = 0.0
    for i in range(Q_WB, Q_WB + 4):
        length += state[i] * state[i]
    for i in range(Q_WB, Q_WB + 4):
        state[i] /= np.sqrt(length)


@compilable
def geared_step(
    plant: Plant,
    state: Array,
    inputs: Inputs,
    step: float,
    work: Workspace,
    slopes: Slopes,
    moved: Array,
) -> None:
    """``rk4_step`` of ``step`` [s] with the gaps of the gears; ``moved`` (6,) [rad] is memory.

    The ``state`` (n,) [SI] is advanced in place; ``work`` has placed its bodies.
    """
    joints, angles = plant.chain.joints, first_angle(plant)
    rates = state[angles + joints :]
    placed_acceleration_into(plant, state, inputs, work)
    part_teeth(plant.gears, inputs.torque, work.load, rates)
    for i in range(joints):
        moved[i] = -state[angles + i]
    rk4_step(plant, state, inputs, step, work, slopes)
    for i in range(joints):
        moved[i] += state[angles + i]
    if move_free(plant.gears, inputs.torque, moved, rates, step):
        strike(plant, state, moved, work)


@compilable
def strike(plant: Plant, state: Array, momentum: Array, work: Workspace) -> None:
    """Let motors strike joints with a ``momentum`` (6,) [N·m·s]; state (n,) [SI]."""
    joints, rates = plant.chain.joints, first_angle(plant) + plant.chain.joints
    place_bodies(plant, state, work)
    mass_matrix_into(plant.chain, work.posture, work.mass)
    for i in range(6):
        work.load[i] = 0.0
    for i in range(joints):
        work.mass[6 + i, 6 + i] += plant.gears.carried[i]
        work.load[6 + i] = momentum[i]
    solve_in_place(work.mass, work.load, 6 + joints)
    put(state, V_WB, add(triple(state, V_WB), times(work.rotation, triple(work.load, 0))))
    put(state, W_WB_B, add(triple(state, W_WB_B), triple(work.load, 3)))
    for i in range(joints):
        state[rates + i] += work.load[6 + i]


@compilable
def run_steps(
    plant: Plant,
    state: Array,
    inputs: Inputs,
    step: float,
    places: Array,
    states: Array,
    memory: Memory,
) -> Arrival:
    """``integrate`` with ``memory`` to write to.

    The ``state`` (n,) [SI] is advanced in place by as many steps of ``step`` [s] as
    ``places`` (steps, rows, 3) [m, NED] has room for; ``states`` (steps, n) [SI] follow it.
    """
    moved, work, now = memory.moved, memory.work, memory.now
    n, fastest = state_size(plant), 0.0
    for i in range(n):
        now[i] = state[i]
    place_bodies(plant, now, work)
    for k in range(places.shape[0]):
        loose, parts = plant.gears.gap > 0.0, 1
        if plant.surfaces.number > 0:
            how = (plant.balls, plant.surfaces, work.posture, work.rotation)
            parts = steps_within(*how, triple(now, P_WB), step)
        for part in range(parts):
            if part > 0:
                place_bodies(plant, now, work)
            if loose:
                geared_step(plant, now, inputs, step / parts, work, memory.slopes, moved)
            else:
                rk4_step(plant, now, inputs, step / parts, work, memory.slopes)
        place_bodies(plant, now, work)
        places_of_bodies(plant, now, work, k, places)
        for i in range(n):
            states[k, i] = now[i]
        if loose:
            servo_rates_into(plant.gears, states[k, n - plant.chain.joints :])
        fastest = max(fastest, touch_down_speed(plant, now, work))
    for i in range(n):
        state[i] = now[i]
    return Arrival(fastest, specific_force(plant, now, inputs, work))


class Held(NamedTuple):
    """Inputs of a step and all memory that it writes, in one block."""

    inputs: Inputs
    memory: Memory


def held() -> Sequence[Held]:
    """A block for ``step`` and any vehicle, in an array of one."""
    inputs = Inputs(np.zeros(ROTORS_MAX), np.zeros(JOINTS_MAX), np.zeros(3), np.zeros(3))
    slopes = Slopes(np.zeros(STATE_MAX), np.zeros(STATE_MAX), np.zeros(STATE_MAX))
    memory = Memory(empty_workspace(), slopes, np.zeros(JOINTS_MAX), np.zeros(STATE_MAX))
    return cast(Sequence[Held], np.array([pack_params(Held(inputs, memory))]))


@kernel
def integrate(
    plant: Plant,
    state: Array,
    inputs: Inputs,
    step: float,
    places: Array,
    states: Array,
    blocks: Sequence[Held],
) -> Arrival:
    """Advance ``state`` (n,) [SI] in place by one ``step`` [s] per row of ``places``.

    The inputs are held over all steps; ``blocks`` is one, for memory.

    Base origin, joints and end-effector go to places (steps, 2 + j, 3) [m, NED], after each step,
    and the state itself to ``states`` (steps, n) [SI], but with the rates of the joints' servos,
    which limits are about; without rows the state stays as it is.
    """
    return run_steps(plant, state, inputs, step, places, states, blocks[0].memory)


@kernel
def step(
    plants: Sequence[Plant],
    blocks: Sequence[Held],
    state: Array,
    thrust: V8,
    torque: V6,
    force_W: V3,
    torque_B: V3,
    step_s: float,
    places: Array,
    states: Array,
) -> tuple[float, V3]:
    """``integrate`` with plant and memory in arrays of one, inputs in tuples: the cheapest to call.

    One call does all that an exchange needs, because handing the plant's arrays to compiled code
    one by one costs as much as two steps.

    ``thrust`` [N] and ``torque`` [N·m] are commanded, of rotors and joints, with anything behind;
    ``force_W`` [N, NED] and ``torque_B`` [N·m, B] disturb the base.

    Overwritten are state (n,) [SI], places (steps, 2 + j, 3) [m, NED] and ``states``
    (steps, n) [SI].
    """
    inputs = blocks[0].inputs
    for i in range(ROTORS_MAX):
        inputs.thrust[i] = thrust[i]
    for i in range(JOINTS_MAX):
        inputs.torque[i] = torque[i]
    put(inputs.force_W, 0, force_W)
    put(inputs.torque_B, 0, torque_B)
    arrival = run_steps(plants[0], state, inputs, step_s, places, states, blocks[0].memory)
    return arrival.landing_speed, arrival.felt


@kernel
def places(plant: Plant, state: Array, blocks: Sequence[Held], out: Array) -> None:
    """``places_of_bodies`` for one state (n,) [SI], into out (1, 2 + j, 3) [m, NED].

    ``blocks`` is one, for memory.
    """
    memory = blocks[0].memory
    for i in range(state_size(plant)):
        memory.now[i] = state[i]
    place_bodies(plant, memory.now, memory.work)
    places_of_bodies(plant, memory.now, memory.work, 0, out)
