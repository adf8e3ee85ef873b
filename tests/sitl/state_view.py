"""Names for the parts of the plant's state vector."""

from __future__ import annotations

from dataclasses import dataclass

from sitl.plant.state import P_WB, Q_WB, THRUST, V_WB, W_WB_B
from sitl.plant.vector import Array


@dataclass(frozen=True, slots=True)
class StateView:
    """Named views into one state vector (writing through them changes it)."""

    vector: Array  # (13 + r + 2j,)
    joints: int = 2

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
        """(r,) N."""
        return self.vector[THRUST : len(self.vector) - 2 * self.joints]

    @property
    def q_arm(self) -> Array:
        """(j,) rad."""
        return self.vector[-2 * self.joints : -self.joints]

    @property
    def qd_arm(self) -> Array:
        """(j,) rad/s."""
        return self.vector[-self.joints :]
