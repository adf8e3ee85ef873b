"""The plant's state vector: the only place that knows which entry is what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sitl.plant.vector import Array

# First entry of each part; compiled kernels use these too (numba freezes them as constants).
P_WB: Final = 0  # m, base origin, NED
V_WB: Final = 3  # m/s, its velocity, NED
Q_WB: Final = 6  # attitude [w, x, y, z], maps B to W
W_WB_B: Final = 10  # rad/s, written in B
THRUST: Final = 13  # N, of rotors 1..4
ARM: Final = 17  # j angles [rad], then j rates [rad/s]


@dataclass(frozen=True, slots=True)
class StateView:
    """Named views into one state vector (writing through them changes it)."""

    vector: Array  # (17 + 2j,)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return int(self.vector.shape[0] - ARM) // 2

    @property
    def p_WB(self) -> Array:
        """(3,) m, NED."""
        return self.vector[P_WB:V_WB]

    @property
    def v_WB(self) -> Array:
        """(3,) m/s, NED."""
        return self.vector[V_WB:Q_WB]

    @property
    def q_WB(self) -> Array:
        """(4,) [w, x, y, z]."""
        return self.vector[Q_WB:W_WB_B]

    @property
    def w_WB_B(self) -> Array:
        """(3,) rad/s, B."""
        return self.vector[W_WB_B:THRUST]

    @property
    def thrust(self) -> Array:
        """(4,) N."""
        return self.vector[THRUST:ARM]

    @property
    def q_arm(self) -> Array:
        """(j,) rad."""
        return self.vector[ARM : ARM + self.joints]

    @property
    def qd_arm(self) -> Array:
        """(j,) rad/s."""
        return self.vector[ARM + self.joints :]


def at_rest(joints: int) -> Array:
    """State of a level vehicle at the origin, nothing moving, rotors off, arm straight down."""
    state = np.zeros(ARM + 2 * joints)
    StateView(state).q_WB[0] = 1.0
    return state
