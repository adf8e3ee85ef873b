"""More thrust below a ceiling, which the air must come in along."""

from __future__ import annotations

import math

from sitl.compiled import kernel

NEAREST = 0.1  # rotor radii


@kernel
def ceiling_effect(radius: float, distance: float) -> float:
    r"""Thrust of a rotor over that without a ceiling [1], at the same power.

    A rotor of a ``radius`` [m] at a ``distance`` [m] below it. Momentum theory with an inflow that
    is radial between ceiling and disc:

    .. math:: \frac{T}{T_\infty} = γ^{2/3}, \quad
              γ = \tfrac12 + \tfrac12 \sqrt{1 + \tfrac18 (R/D)^2}

    Source: Y. H. Hsiao, P. Chirarattananon, Ceiling Effects for Hybrid Aerial-Surface Locomotion of
    Small Rotorcraft, IEEE/ASME Trans. Mechatronics 24 (2019) 2316, section II; the ratio at equal
    power follows from its induced velocity.
    """
    near = radius / max(distance, NEAREST * radius)
    share = 0.5 + 0.5 * math.sqrt(1.0 + 0.125 * near * near)
    return float(share ** (2.0 / 3.0))
