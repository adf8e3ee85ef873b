"""The whole vehicle as one ordinary differential equation.

Source: docs/equations.md E1, E2, E3, E6.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.air.load import Air, drag_force, rotor_gain, wall_force
from sitl.compiled import compilable, kernel
from sitl.plant.actuators import joint_torque, stop_torque, thrust_rate
from sitl.plant.bodies import Chain, Points, Posture, empty_posture, posture_into
from sitl.plant.contact import Balls, Feet, Surfaces, ground_wrench, touch_into
from sitl.plant.gears import Gears
from sitl.plant.mass_matrix import mass_matrix_into, solve_in_place
from sitl.plant.newton_euler import wrench_needed_into
from sitl.plant.rotor_speed import quadratic_thrust_rate
from sitl.plant.state import JOINTS_MAX, P_WB, Q_WB, THRUST, V_WB, W_WB_B
from sitl.plant.vector import (
    V3,
    Array,
    add,
    put,
    rotation_into,
    row,
    scale,
    times,
    transposed_times,
    triple,
)


class Rotors(NamedTuple):
    """Numbers of the rotors for the kernels, an entry a rotor; there is room for eight."""

    number: int
    place: Array  # (8, 3) m, hub in B
    axis: Array  # (8, 3) direction of the thrust in B
    moment: Array  # (8, 3) m, of the thrust about the base origin, per thrust
    reaction: Array  # (8, 3) m, torque on the base against the shaft's, per thrust in free air
    thrust_max: Array  # (8,) N
    lag: Array  # (8,) s
    quadratic: int  # 1: the speed lags, not the thrust


class Drives(NamedTuple):
    """Numbers of the joint drives for the kernels, an entry a joint."""

    torque_max: Array  # (6,) N·m
    viscous: Array  # (6,) N·m·s/rad
    coulomb: Array  # (6,) N·m


class Stops(NamedTuple):
    """End stops: each bounds a sum of joint angles, and pushes back with the same shares."""

    number: int
    share: Array  # (70, 6) of each joint's angle
    least: Array  # (70,) rad
    most: Array  # (70,) rad
    stiffness: float  # N·m/rad
    damping: float  # N·m·s/rad


class Plant(NamedTuple):
    """Every number the kernels need; numba reads them by name from one block of memory."""

    chain: Chain
    feet: Feet
    rotors: Rotors
    drives: Drives
    stops: Stops
    gears: Gears
    air: Air
    points: Points
    balls: Balls
    surfaces: Surfaces
    locked: Array  # (6,) 1 for a joint that cannot move, which is then at rest; else 0
    gravity: float  # m/s²


class Inputs(NamedTuple):
    """What acts on the plant, constant over a step."""

    thrust: Array  # (8,) N commanded
    torque: Array  # (6,) N·m commanded
    force_W: Array  # (3,) N on the base origin, NED
    torque_B: Array  # (3,) N·m on the base, B


class Workspace(NamedTuple):
    """Memory that one evaluation of the derivative writes."""

    posture: Posture
    rotation: Array  # (3, 3) R_WB
    mass: Array  # (12, 12)
    load: Array  # (12,) generalised force, then acceleration
    bias: Array  # (12,) force that gravity and velocities take up
    still: Array  # (6,) zeros


def empty_workspace() -> Workspace:
    """Memory for any vehicle."""
    n = 6 + JOINTS_MAX
    return Workspace(
        empty_posture(),
        np.empty((3, 3)),
        np.empty((n, n)),
        np.empty(n),
        np.empty(n),
        np.zeros(JOINTS_MAX),
    )


@kernel
def first_angle(plant: Plant) -> int:
    """Entry of the first joint's angle in the state vector."""
    return THRUST + int(plant.rotors.number)


@compilable
def gravity_in_body(rotation: Array, g: float) -> V3:
    """Gravity g [m/s²] in B for the rotation (3, 3) [1], R_WB; in NED it points along +z."""
    return transposed_times(rotation, (0.0, 0.0, g))


@compilable
def load_into(plant: Plant, state: Array, inputs: Inputs, work: Workspace) -> None:
    """All that acts but gravity at a state (n,) [SI], whose bodies ``work`` has placed, into it."""
    load, rotation, rotors, air = work.load, work.rotation, plant.rotors, plant.air
    p = triple(state, P_WB)
    force, moment = ground_wrench(
        plant.feet, p, triple(state, V_WB), triple(state, W_WB_B), rotation
    )
    force = add(force, transposed_times(rotation, triple(inputs.force_W, 0)))
    moment = add(moment, triple(inputs.torque_B, 0))
    if air.active > 0:
        force = add(force, drag_force(air, triple(state, V_WB), rotation))
    for i in range(rotors.number):
        # The air's laws are of thrust at the same power, which is the same torque at the same
        # speed: what a surface adds to the thrust, it does not add to the torque of the shaft.
        thrust = shaft = state[THRUST + i]
        if air.active > 0:
            hub = add(p, times(rotation, row(rotors.place, i)))
            thrust *= rotor_gain(air, hub, i)
            force = add(force, transposed_times(rotation, wall_force(air, hub, i, thrust)))
        force = add(force, scale(thrust, row(rotors.axis, i)))
        moment = add(moment, scale(thrust, row(rotors.moment, i)))
        moment = add(moment, scale(shaft, row(rotors.reaction, i)))
    put(load, 0, force)
    put(load, 3, moment)
    joints, drives, angles = plant.chain.joints, plant.drives, first_angle(plant)
    for i in range(joints):
        # Within the gap of its gear the motor drives no link.
        driven = plant.gears.gap == 0.0 or plant.gears.side[i] != 0.0
        load[6 + i] = joint_torque(
            inputs.torque[i] if driven else 0.0,
            state[angles + joints + i],
            drives.torque_max[i],
            drives.viscous[i],
            drives.coulomb[i],
        )
    stops_into(plant.stops, state, angles, joints, load)
    if plant.surfaces.number > 0:
        how = (plant.chain, plant.balls, plant.surfaces, work.posture, rotation)
        touch_into(*how, state, angles, load)


@compilable
def stops_into(stops: Stops, state: Array, angles: int, joints: int, load: Array) -> None:
    """Add the torques of all end stops that are touched to load (6 + j,) [SI].

    Of so many ``joints``, the first one's angle in entry ``angles`` of a state (n,) [SI].
    """
    for k in range(stops.number):
        angle = 0.0
        for i in range(joints):
            angle += stops.share[k, i] * state[angles + i]
        if angle < stops.least[k] or angle > stops.most[k]:
            rate = 0.0
            for i in range(joints):
                rate += stops.share[k, i] * state[angles + joints + i]
            beyond = angle - min(max(angle, stops.least[k]), stops.most[k])
            push = stop_torque(beyond, rate, stops.stiffness, stops.damping)
            for i in range(joints):
                load[6 + i] += stops.share[k, i] * push


@kernel
def place_bodies(plant: Plant, state: Array, work: Workspace) -> None:
    """Rotation and posture of a state (n,) [SI] into ``work``."""
    rotation_into(state, Q_WB, work.rotation)
    posture_into(plant.chain, state, first_angle(plant), work.posture)


@kernel
def placed_acceleration_into(plant: Plant, state: Array, inputs: Inputs, work: Workspace) -> None:
    """Solve M x = load − bias into ``work.load``: base linear and angular, joint accelerations.

    Taken at a state (n,) [SI], see ``sitl.plant.state``, whose bodies ``work`` has placed.

    The linear part is the acceleration of the base origin written in B (not the rate of the
    velocity's components in B).
    """
    joints, load, bias = plant.chain.joints, work.load, work.bias
    lift = scale(-1.0, gravity_in_body(work.rotation, plant.gravity))
    w, still = triple(state, W_WB_B), (0.0, 0.0, 0.0)
    rates = state[first_angle(plant) + joints :]
    wrench_needed_into(plant.chain, work.posture, w, still, lift, rates, work.still, bias)
    load_into(plant, state, inputs, work)
    for i in range(6 + joints):
        load[i] -= bias[i]
    mass_matrix_into(plant.chain, work.posture, work.mass)
    for i in range(joints):
        work.mass[6 + i, 6 + i] += plant.gears.carried[i]
        if plant.locked[i] > 0.0:
            hold_joint(work.mass, load, 6 + i, 6 + joints)
    solve_in_place(work.mass, load, 6 + joints)


@compilable
def hold_joint(mass: Array, load: Array, row: int, n: int) -> None:
    """Replace one row of mass (n, n) [any unit] x = load (n,) [any unit] by x[row] = 0.

    The torque that this takes acts between two links and does no work.
    """
    for k in range(row):
        mass[row, k] = 0.0
    for k in range(row + 1, n):
        mass[k, row] = 0.0
    mass[row, row] = 1.0
    load[row] = 0.0


@compilable
def derivative_into(
    plant: Plant, state: Array, inputs: Inputs, work: Workspace, out: Array
) -> None:
    """Time derivative into out (n,) [SI/s] at a state (n,) [SI].

    ``work`` has placed the bodies.
    """
    placed_acceleration_into(plant, state, inputs, work)
    put(out, P_WB, triple(state, V_WB))
    put(out, V_WB, times(work.rotation, triple(work.load, 0)))
    put(out, W_WB_B, triple(work.load, 3))
    w, x, y, z = state[Q_WB], state[Q_WB + 1], state[Q_WB + 2], state[Q_WB + 3]
    a, b, c = triple(state, W_WB_B)
    out[Q_WB] = -0.5 * (x * a + y * b + z * c)
    out[Q_WB + 1] = 0.5 * (w * a + y * c - z * b)
    out[Q_WB + 2] = 0.5 * (w * b + z * a - x * c)
    out[Q_WB + 3] = 0.5 * (w * c + x * b - y * a)
    rotors = plant.rotors
    for i in range(rotors.number):
        thrust, command = state[THRUST + i], inputs.thrust[i]
        if rotors.quadratic > 0:
            rate = quadratic_thrust_rate(thrust, command, rotors.thrust_max[i], rotors.lag[i])
        else:
            rate = thrust_rate(thrust, command, rotors.thrust_max[i], rotors.lag[i])
        out[THRUST + i] = rate
    angles, joints = first_angle(plant), plant.chain.joints
    for i in range(joints):
        out[angles + i] = state[angles + joints + i]
        out[angles + joints + i] = work.load[6 + i]
