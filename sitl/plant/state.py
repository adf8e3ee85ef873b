"""The plant's state vector: the only place that knows which entry is what."""

from __future__ import annotations

from typing import Final

import numpy as np

from sitl.plant.vector import V3, V4, Array

# First entry of each part; compiled kernels use these too (numba freezes them as constants).
P_WB: Final = 0  # m, base origin, NED
V_WB: Final = 3  # m/s, its velocity, NED
Q_WB: Final = 6  # attitude [w, x, y, z], maps B to W
W_WB_B: Final = 10  # rad/s, written in B
THRUST: Final = 13  # N, of rotors 1..4
ARM: Final = 17  # j angles [rad], then j rates [rad/s]


def taken_apart(state: Array) -> tuple[V3, V3, V4, V3, V4, tuple[float, ...]]:
    """Place, velocity, attitude, rate, thrusts and arm of a ``state`` (17 + 2j,) [SI]."""
    # As a list at once: a view into the vector costs as much as all of this.
    px, py, pz, vx, vy, vz, qw, qx, qy, qz, wx, wy, wz, f1, f2, f3, f4, *arm = state.tolist()
    q, thrust = (qw, qx, qy, qz), (f1, f2, f3, f4)
    return (px, py, pz), (vx, vy, vz), q, (wx, wy, wz), thrust, tuple(arm)


def at_rest(joints: int) -> Array:
    """State of a level vehicle at the origin, nothing moving, rotors off, arm straight down."""
    state = np.zeros(ARM + 2 * joints)
    state[Q_WB] = 1.0
    return state
