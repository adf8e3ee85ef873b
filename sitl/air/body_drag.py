"""Drag of frame, arm and battery, quadratic in the speed through the air."""

from __future__ import annotations

import math

from sitl.compiled import kernel
from sitl.plant.vector import V3, scale


@kernel
def body_drag(area: float, density: float, v: V3) -> V3:
    r"""Force [N, B] at a velocity v [m/s, B] through air of a ``density`` [kg/m³].

    The drag area [m²], :math:`c_D A`, is the same from all sides:

    .. math:: f = -\tfrac12 ρ\, c_D A\, |v| v

    Source: J. D. Anderson, Fundamentals of Aerodynamics, section 1.5.
    """
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return scale(-0.5 * density * area * speed, v)
