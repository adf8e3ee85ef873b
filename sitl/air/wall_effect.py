"""A pull towards a wall beside a rotor.

There is no formula that the literature agrees upon. Measurements find hardly any change of thrust,
and a pull towards the wall that falls quickly with the distance. The form here is that of a
mirrored rotor, as for the ground; how strong it is says the scenario.
"""

from __future__ import annotations

from sitl.compiled import kernel

NEAREST = 1.0  # rotor radii: the blades touch


@kernel
def wall_pull(suction: float, radius: float, distance: float, thrust: float) -> float:
    r"""Force [N] towards a wall on a rotor of a ``radius`` [m] whose hub is ``distance`` [m] away.

    .. math:: f = κ\, T (R/d)^2

    κ is ``suction`` [1], the share of its ``thrust`` [N] where the blades touch.
    """
    near = radius / max(distance, NEAREST * radius)
    return suction * thrust * near * near
