"""The plant's state vector: the only place that knows which entry is what.

It is as long as the vehicle needs: 13 + r + 2j entries for r rotors and j joints. Records of
kernels have room for the most of both instead, so that one compile serves every vehicle.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sitl.plant.vector import V3, V4, Array
from vehicles.description import JOINTS_MAX as JOINTS_MAX
from vehicles.description import ROTORS_MAX as ROTORS_MAX

SURFACES_MAX: Final = 8  # of a scenario that the tool may touch
PARTS_MAX: Final = 64  # that a vehicle has of feet, critical points, parts, and coupled limits each

# First entry of each part; compiled kernels use these too (numba freezes them as constants).
P_WB: Final = 0  # m, base origin, NED
V_WB: Final = 3  # m/s, its velocity, NED
Q_WB: Final = 6  # attitude [w, x, y, z], maps B to W
W_WB_B: Final = 10  # rad/s, written in B
THRUST: Final = 13  # N, of every rotor; then the joints' angles [rad], then their rates [rad/s]

STATE_MAX: Final = THRUST + ROTORS_MAX + 2 * JOINTS_MAX


def taken_apart(
    state: Array, rotors: int
) -> tuple[V3, V3, V4, V3, tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """Place, velocity, attitude, rate, thrusts, angles, rates of a ``state`` (13 + r + 2j,) [SI].

    The vehicle has so many ``rotors``.
    """
    # As a list at once: a view into the vector costs as much as all of this.
    px, py, pz, vx, vy, vz, qw, qx, qy, qz, wx, wy, wz, *rest = state.tolist()
    joints = (len(rest) - rotors) // 2
    thrust, angles, rates = rest[:rotors], rest[rotors : rotors + joints], rest[rotors + joints :]
    motion = (px, py, pz), (vx, vy, vz), (qw, qx, qy, qz), (wx, wy, wz)
    return *motion, tuple(thrust), tuple(angles), tuple(rates)


def at_rest(rotors: int, joints: int) -> Array:
    """State of a level vehicle at the origin, nothing moving, rotors off, all joints at zero."""
    state = np.zeros(THRUST + rotors + 2 * joints)
    state[Q_WB] = 1.0
    return state
