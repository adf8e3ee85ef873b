"""The whole vehicle as one ordinary differential equation.

Source: docs/equations.md E1, E2, E3, E6.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.air.load import SURFACES, Air, drag_force, rotor_gain, wall_force
from sitl.compiled import kernel
from sitl.plant.actuators import joint_torque, rotor_torque, stop_torque, thrust_rate
from sitl.plant.bodies import Chain, Posture, empty_posture, posture_into
from sitl.plant.contact import Feet, ground_wrench
from sitl.plant.gears import Gears, gears
from sitl.plant.mass_matrix import mass_matrix_into, solve_in_place
from sitl.plant.newton_euler import wrench_needed_into
from sitl.plant.packing import pack_params
from sitl.plant.parameters import Joints, Rotors, Vehicle, chain
from sitl.plant.rotor_speed import quadratic_thrust_rate
from sitl.plant.state import ARM, P_WB, Q_WB, THRUST, V_WB, W_WB_B
from sitl.plant.vector import (
    V3,
    Array,
    add,
    put,
    rotation_into,
    scale,
    times,
    transposed_times,
    triple,
)


class Stops(NamedTuple):
    """Numbers of the end stops for the kernels (see ``parameters.EndStops``)."""

    angle: Array  # (j,) rad, of each link against the base; infinite where there is none
    stiffness: float  # N·m/rad
    damping: float  # N·m·s/rad


class Plant(NamedTuple):
    """Every number the kernels need; numba reads them by name from one block of memory."""

    chain: Chain
    feet: Feet
    rotors: Rotors
    joints: Joints
    stops: Stops
    gears: Gears
    air: Air
    locked: Array  # (j,) 1 for a joint that cannot move, which is then at rest; else 0
    gravity: float  # m/s²


class Inputs(NamedTuple):
    """What acts on the plant, constant over a step."""

    thrust: Array  # (4,) N commanded
    torque: Array  # (j,) N·m commanded
    force_W: Array  # (3,) N on the base origin, NED
    torque_B: Array  # (3,) N·m on the base, B


class Workspace(NamedTuple):
    """Memory that one evaluation of the derivative writes."""

    posture: Posture
    rotation: Array  # (3, 3) R_WB
    mass: Array  # (6+j, 6+j)
    load: Array  # (6+j,) generalised force, then acceleration
    bias: Array  # (6+j,) force that gravity and velocities take up
    still: Array  # (j,) zeros


def plant(vehicle: Vehicle) -> Plant:
    """The numbers of a vehicle for the kernels."""
    legs = vehicle.legs
    s, h = legs.spread, legs.length
    points = np.array([(x, y, h) for x in (-s, s) for y in (-s, s)])
    stops = vehicle.stops
    stop_angle = np.full(len(vehicle.links), np.inf)
    stop_angle[: len(stops.angle)] = stops.angle[: len(stop_angle)]
    numbers = Plant(
        chain=chain(vehicle),
        feet=Feet(
            points=points,
            reach=float(np.linalg.norm(points[0])),
            stiffness=legs.stiffness,
            dissipation=legs.dissipation,
            friction=legs.friction,
            slip_rate=legs.slip_rate,
        ),
        rotors=vehicle.rotors,
        joints=vehicle.joints,
        stops=Stops(stop_angle, stops.stiffness, stops.damping),
        gears=gears(vehicle.motors.inertia, vehicle.motors.backlash, len(vehicle.links)),
        air=_air(vehicle),
        locked=np.zeros(len(vehicle.links)),
        gravity=vehicle.gravity,
    )
    return pack_params(numbers)


def _air(vehicle: Vehicle) -> Air:
    model, rotors = vehicle.air, vehicle.rotors
    surfaces = np.zeros((SURFACES, 4))
    for k, (normal, offset) in enumerate(model.surfaces):
        surfaces[k] = (*normal, offset)
    return Air(
        active=float(model.active),
        wind=np.zeros(3),
        drag=vehicle.mass * np.array(model.rotor_drag),
        area=model.drag_area,
        density=model.density,
        radius=vehicle.size.blade,
        arm=rotors.arm,
        ground=float(model.ground),
        ceiling=float(model.ceiling),
        suction=model.suction,
        surfaces=surfaces,
        surface_count=float(len(model.surfaces)),
    )


def empty_workspace(joints: int) -> Workspace:
    """Memory for a vehicle with ``joints`` joints."""
    n = 6 + joints
    return Workspace(
        empty_posture(joints),
        np.empty((3, 3)),
        np.empty((n, n)),
        np.empty(n),
        np.empty(n),
        np.zeros(joints),
    )


@kernel
def gravity_in_body(rotation: Array, g: float) -> V3:
    """Gravity g [m/s²] in B for the rotation (3, 3) [1], R_WB; in NED it points along +z."""
    return transposed_times(rotation, (0.0, 0.0, g))


@kernel
def load_into(plant: Plant, state: Array, inputs: Inputs, work: Workspace) -> None:
    """Forces of rotors, drives, ground, disturbance at a state (17 + 2j,) [SI], into work.load."""
    load, rotation = work.load, work.rotation
    feet_force, feet_moment = ground_wrench(
        plant.feet, triple(state, P_WB), triple(state, V_WB), triple(state, W_WB_B), rotation
    )
    thrust = (state[THRUST], state[THRUST + 1], state[THRUST + 2], state[THRUST + 3])
    # The air's laws are of thrust at the same power, which is the same torque at the same speed:
    # what a surface adds to the thrust, it does not add to the torque of the shaft.
    shaft = thrust
    air = plant.air
    if air.active > 0.0:
        p = triple(state, P_WB)
        thrust = (
            rotor_gain(air, p, rotation, 0) * thrust[0],
            rotor_gain(air, p, rotation, 1) * thrust[1],
            rotor_gain(air, p, rotation, 2) * thrust[2],
            rotor_gain(air, p, rotation, 3) * thrust[3],
        )
    lift = (0.0, 0.0, -(thrust[0] + thrust[1] + thrust[2] + thrust[3]))
    push = transposed_times(rotation, triple(inputs.force_W, 0))
    force = add(add(lift, push), feet_force)
    if air.active > 0.0:
        force = add(force, drag_force(air, triple(state, V_WB), rotation))
        force = add(force, wall_force(air, triple(state, P_WB), rotation, thrust))
    put(load, 0, force)
    turn = rotor_torque(thrust, shaft, plant.rotors.arm, plant.rotors.yaw_ratio)
    put(load, 3, add(add(turn, triple(inputs.torque_B, 0)), feet_moment))
    joints, drive, stops = work.still.shape[0], plant.joints, plant.stops
    for i in range(joints):
        rate = state[ARM + joints + i]
        # Within the gap of its gear the motor drives no link.
        driven = plant.gears.gap == 0.0 or plant.gears.side[i] != 0.0
        load[6 + i] = joint_torque(
            inputs.torque[i] if driven else 0.0,
            rate,
            drive.torque_max,
            drive.viscous,
            drive.coulomb,
            drive.coulomb_rate,
        )
    angle, rate = 0.0, 0.0  # of a link against the base: of all joints up to it
    for i in range(joints):
        angle += state[ARM + i]
        rate += state[ARM + joints + i]
        if abs(angle) > stops.angle[i]:
            stop = stop_torque(angle, rate, stops.angle[i], stops.stiffness, stops.damping)
            for k in range(i + 1):
                load[6 + k] += stop


@kernel
def place_bodies(plant: Plant, state: Array, work: Workspace) -> None:
    """Rotation and posture of a state (17 + 2j,) [SI] into ``work``."""
    joints = work.still.shape[0]
    rotation_into(state, Q_WB, work.rotation)
    posture_into(plant.chain, state[ARM : ARM + joints], work.posture)


@kernel
def acceleration_into(plant: Plant, state: Array, inputs: Inputs, work: Workspace) -> None:
    """``placed_acceleration_into`` for any state (17 + 2j,) [SI]."""
    place_bodies(plant, state, work)
    placed_acceleration_into(plant, state, inputs, work)


@kernel
def placed_acceleration_into(plant: Plant, state: Array, inputs: Inputs, work: Workspace) -> None:
    """Solve M x = load − bias into ``work.load``: base linear and angular, joint accelerations.

    Taken at a state (17 + 2j,) [SI], see ``sitl.plant.state``, whose bodies ``work`` has placed.

    The linear part is the acceleration of the base origin written in B (not the rate of the
    velocity's components in B).
    """
    joints, load, bias = work.still.shape[0], work.load, work.bias
    lift = scale(-1.0, gravity_in_body(work.rotation, plant.gravity))
    w, still = triple(state, W_WB_B), (0.0, 0.0, 0.0)
    rates = state[ARM + joints :]
    wrench_needed_into(plant.chain, work.posture, w, still, lift, rates, work.still, bias)
    load_into(plant, state, inputs, work)
    for i in range(6 + joints):
        load[i] -= bias[i]
    mass_matrix_into(plant.chain, work.posture, work.mass)
    for i in range(joints):
        work.mass[6 + i, 6 + i] += plant.gears.carried[i]
        if plant.locked[i] > 0.0:
            hold_joint(work.mass, load, 6 + i)
    solve_in_place(work.mass, load)


@kernel
def hold_joint(mass: Array, load: Array, row: int) -> None:
    """Replace one row of mass (n, n) [any unit] x = load (n,) [any unit] by x[row] = 0.

    The torque that this takes acts between two links and does no work.
    """
    for k in range(row):
        mass[row, k] = 0.0
    for k in range(row + 1, load.shape[0]):
        mass[k, row] = 0.0
    mass[row, row] = 1.0
    load[row] = 0.0


@kernel
def derivative_into(
    plant: Plant, state: Array, inputs: Inputs, work: Workspace, out: Array
) -> None:
    """Time derivative into out (17 + 2j,) [SI/s] at a state (17 + 2j,) [SI].

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
    limit, lag = plant.rotors.thrust_max, plant.rotors.lag
    for i in range(4):
        thrust, command = state[THRUST + i], inputs.thrust[i]
        if plant.rotors.quadratic > 0.0:
            out[THRUST + i] = quadratic_thrust_rate(thrust, command, limit, lag)
        else:
            out[THRUST + i] = thrust_rate(thrust, command, limit, lag)
    joints = work.still.shape[0]
    for i in range(joints):
        out[ARM + i] = state[ARM + joints + i]
        out[ARM + joints + i] = work.load[6 + i]
