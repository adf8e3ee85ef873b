"""The whole vehicle as one ordinary differential equation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.compiled import compiled
from sitl.plant.actuators import joint_torque, rotor_torque, thrust_rate
from sitl.plant.contact import Feet, ground_wrench
from sitl.plant.newton_euler import (
    Chain,
    Posture,
    empty_posture,
    gravity_in_body,
    mass_matrix_into,
    posture_into,
    solve_in_place,
    wrench_needed_into,
)
from sitl.plant.parameters import Vehicle, chain
from sitl.plant.state import JOINTS_FROM, P_WB, Q_WB, THRUST, V_WB, W_WB_B
from sitl.plant.vector import (
    Array,
    add,
    put,
    rotation_into,
    row,
    scale,
    times,
    transposed_times,
)


class Plant(NamedTuple):
    """Every number the kernels need."""

    chain: Chain
    feet: Feet
    rotors: Array  # arm m, yaw ratio m, thrust_max N, lag s
    joints: Array  # torque_max N·m, viscous N·m·s/rad, coulomb N·m, coulomb rate rad/s
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
    still: Array  # (j,) zeros


def plant(vehicle: Vehicle) -> Plant:
    """Pack a vehicle for the kernels."""
    legs, rotors, joints = vehicle.legs, vehicle.rotors, vehicle.joints
    s, h = legs.spread, legs.length
    points = np.array([(x, y, h) for x in (-s, s) for y in (-s, s)])
    return Plant(
        chain=chain(vehicle),
        feet=Feet(
            points=points,
            reach=float(np.linalg.norm(points[0])),
            stiffness=legs.stiffness,
            dissipation=legs.dissipation,
            friction=legs.friction,
            slip_rate=legs.slip_rate,
        ),
        rotors=np.array([rotors.arm, rotors.yaw_ratio, rotors.thrust_max, rotors.lag]),
        joints=np.array([joints.torque_max, joints.viscous, joints.coulomb, joints.coulomb_rate]),
        gravity=vehicle.gravity,
    )


@compiled
def empty_workspace(joints: int) -> Workspace:
    """Memory for a vehicle with ``joints`` joints."""
    n = 6 + joints
    return Workspace(
        empty_posture(joints), np.empty((3, 3)), np.empty((n, n)), np.empty(n), np.zeros(joints)
    )


@compiled
def load_into(plant: Plant, state: Array, inputs: Inputs, work: Workspace) -> None:
    """Generalised force of everything but inertia: rotors, drives, ground, disturbance."""
    load, rotation = work.load, work.rotation
    joints = work.still.shape[0]
    thrust = state[THRUST]
    feet_force, feet_moment = ground_wrench(
        plant.feet, row(state[P_WB]), row(state[V_WB]), row(state[W_WB_B]), rotation
    )
    lift = (0.0, 0.0, -(thrust[0] + thrust[1] + thrust[2] + thrust[3]))
    push = transposed_times(rotation, row(inputs.force_W))
    put(load[0:3], add(add(lift, push), feet_force))
    turn = rotor_torque(thrust, plant.rotors[0], plant.rotors[1])
    put(load[3:6], add(add(turn, row(inputs.torque_B)), feet_moment))
    drive = plant.joints
    for i in range(joints):
        rate = state[JOINTS_FROM + joints + i]
        load[6 + i] = joint_torque(inputs.torque[i], rate, drive[0], drive[1], drive[2], drive[3])


@compiled
def acceleration_into(plant: Plant, state: Array, inputs: Inputs, work: Workspace) -> None:
    """Solve M x = load − bias into ``work.load``: base linear and angular, joint accelerations.

    The linear part is the acceleration of the base origin written in B (not the rate of the
    velocity's components in B).
    """
    joints = work.still.shape[0]
    q = state[Q_WB]
    rotation_into(q[0], q[1], q[2], q[3], work.rotation)
    posture_into(plant.chain, state[JOINTS_FROM : JOINTS_FROM + joints], work.posture)
    # The bias (everything that is not mass times acceleration) first lands in the first row
    # of the mass matrix, which is not yet in use.
    bias = work.mass[0]
    fall = gravity_in_body(work.rotation, plant.gravity)
    wrench_needed_into(
        plant.chain,
        work.posture,
        row(state[W_WB_B]),
        (0.0, 0.0, 0.0),
        scale(-1.0, fall),
        state[JOINTS_FROM + joints :],
        work.still,
        bias,
    )
    load_into(plant, state, inputs, work)
    for i in range(6 + joints):
        work.load[i] -= bias[i]
    mass_matrix_into(plant.chain, work.posture, work.mass)
    solve_in_place(work.mass, work.load)


@compiled
def derivative_into(
    plant: Plant, state: Array, inputs: Inputs, work: Workspace, out: Array
) -> None:
    """Time derivative of the state vector (17 + 2j,)."""
    joints = work.still.shape[0]
    acceleration_into(plant, state, inputs, work)
    put(out[P_WB], row(state[V_WB]))
    put(out[V_WB], times(work.rotation, row(work.load)))
    q, w = state[Q_WB], state[W_WB_B]
    rate = out[Q_WB]
    rate[0] = -0.5 * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2])
    rate[1] = 0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1])
    rate[2] = 0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2])
    rate[3] = 0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0])
    put(out[W_WB_B], row(work.load[3:6]))
    thrust, growth = state[THRUST], out[THRUST]
    for i in range(4):
        growth[i] = thrust_rate(thrust[i], inputs.thrust[i], plant.rotors[2], plant.rotors[3])
    for i in range(joints):
        out[JOINTS_FROM + i] = state[JOINTS_FROM + joints + i]
        out[JOINTS_FROM + joints + i] = work.load[6 + i]
