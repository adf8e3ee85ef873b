"""The plant's numbers as one array: handing over ten arrays costs more than two plant steps."""

from __future__ import annotations

import numpy as np

from sitl.compiled import compiled
from sitl.plant.aerial_manipulator import Inputs, Plant
from sitl.plant.bodies import Chain
from sitl.plant.contact import Feet
from sitl.plant.integrator import Arrival, integrate
from sitl.plant.state import ARM
from sitl.plant.vector import V3, V4, Array


def parcel(plant: Plant) -> Array:
    """All numbers of a plant in one row; ``unpacked`` takes them out again."""
    chain, feet = plant.chain, plant.feet
    scalars = (feet.reach, feet.stiffness, feet.dissipation, feet.friction, feet.slip_rate)
    parts = (*chain, plant.rotors, plant.joints, (*scalars, plant.gravity), feet.points)
    return np.concatenate([np.ravel(part) for part in parts])


@compiled
def unpacked(row: Array, joints: int) -> Plant:
    """The plant whose ``parcel`` is ``row``, for an arm with ``joints`` joints."""
    n = joints + 1
    mount_R, row = row[:9].reshape((3, 3)), row[9:]
    mount_p, row = row[:3], row[3:]
    dh, row = row[: 4 * joints].reshape((joints, 4)), row[4 * joints :]
    mass, row = row[:n], row[n:]
    com, row = row[: 3 * n].reshape((n, 3)), row[3 * n :]
    inertia, row = row[: 9 * n].reshape((n, 3, 3)), row[9 * n :]
    rotors, drives, s, points = row[:4], row[4:8], row[8:14], row[14:]
    feet = Feet(points.reshape((points.shape[0] // 3, 3)), s[0], s[1], s[2], s[3], s[4])
    return Plant(Chain(mount_R, mount_p, dh, mass, com, inertia), feet, rotors, drives, s[5])


@compiled
def travel(
    row: Array,
    state: Array,
    thrust: V4,
    torque: tuple[float, ...],
    force_W: V3,
    torque_B: V3,
    step: float,
    places: Array,
) -> Arrival:
    """``integrate`` for a plant in a parcel and inputs in tuples, see ``Inputs``."""
    inputs = Inputs(np.array(thrust), np.array(torque), np.array(force_W), np.array(torque_B))
    plant = unpacked(row, (state.shape[0] - ARM) // 2)
    return integrate(plant, state, inputs, step, places)
