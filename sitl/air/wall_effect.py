"""A pull towards a wall beside a rotor.

The theory of the ground effect with the mirror upright. Cheeseman and Bennett take a rotor for a
source that gives as much air as goes through the disc. The image behind a wall beside it, at the
same height, blows along the disc: thrust stays what it is, as measurements find. The source itself
is pulled towards its image (Lagally), by 3 % of its thrust where the blades touch. Measured pulls
differ from vehicle to vehicle, so that a scenario says how strong it is.
"""

from __future__ import annotations

from typing import Final

from sitl.compiled import kernel

NEAREST = 1.0  # rotor radii: the blades touch
IDEAL: Final = 1.0 / 32.0  # suction of the theory


@kernel
def wall_pull(suction: float, radius: float, distance: float, thrust: float) -> float:
    r"""Force [N] towards a wall on a rotor of a ``radius`` [m] whose hub is ``distance`` [m] away.

    With the induced velocity :math:`v_i` a source of strength :math:`Q = π R^2 v_i`, its image's
    velocity :math:`u = Q / 4π (2d)^2`, the force :math:`ρ Q u` and :math:`T = 2 ρ π R^2 v_i^2`:

    .. math:: f = κ\, T (R/d)^2, \quad κ = \tfrac1{32}

    κ is ``suction`` [1], the share of its ``thrust`` [N] where the blades touch.

    Source: I. C. Cheeseman, W. E. Bennett, ARC R&M 3021, 1955 (source and image); L. M.
    Milne-Thomson, Theoretical Hydrodynamics, on the force on a source (Lagally).
    """
    near = radius / max(distance, NEAREST * radius)
    return suction * thrust * near * near
