"""The plant's state vector: the only place that knows which entry is what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sitl.plant.vector import Array

# Compiled kernels use these slices too; numba freezes them as constants.
P_WB: Final = slice(0, 3)  # m, base origin, NED
V_WB: Final = slice(3, 6)  # m/s, its velocity, NED
Q_WB: Final = slice(6, 10)  # attitude [w, x, y, z], maps B to W
W_WB_B: Final = slice(10, 13)  # rad/s, written in B
THRUST: Final = slice(13, 17)  # N, of rotors 1..4
JOINTS_FROM: Final = 17  # then j angles [rad], then j rates [rad/s]


@dataclass(frozen=True, slots=True)
class StateView:
    """Named views into one state vector (writing through them changes it)."""

    vector: Array  # (17 + 2j,)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return (self.vector.shape[0] - JOINTS_FROM) // 2

    @property
    def p_WB(self) -> Array:
        """(3,) m, NED."""
        return self.vector[P_WB]

    @property
    def v_WB(self) -> Array:
        """(3,) m/s, NED."""
        return self.vector[V_WB]

    @property
    def q_WB(self) -> Array:
        """(4,) [w, x, y, z]."""
        return self.vector[Q_WB]

    @property
    def w_WB_B(self) -> Array:
        """(3,) rad/s, B."""
        return self.vector[W_WB_B]

    @property
    def thrust(self) -> Array:
        """(4,) N."""
        return self.vector[THRUST]

    @property
    def q_arm(self) -> Array:
        """(j,) rad."""
        return self.vector[JOINTS_FROM : JOINTS_FROM + self.joints]

    @property
    def qd_arm(self) -> Array:
        """(j,) rad/s."""
        return self.vector[JOINTS_FROM + self.joints :]


def at_rest(joints: int) -> Array:
    """State of a level vehicle at the origin, nothing moving, rotors off, arm straight down."""
    state = np.zeros(JOINTS_FROM + 2 * joints)
    StateView(state).q_WB[0] = 1.0
    return state
