"""More thrust near a floor: every rotor is a source, and the floor its mirror."""

from __future__ import annotations

import math

from sitl.compiled import compilable, kernel
from sitl.plant.vector import Array

NEAREST = 0.5  # rotor radii; nearer, the theory has no answer


@compilable
def image_share(radius: float, height: float, beside: float) -> float:
    r"""Share of a rotor's induced velocity that one mirrored rotor takes away.

    A rotor of a ``radius`` [m] at a ``height`` [m] above the floor, mirrored, seen from a rotor at
    the same height that stands ``beside`` it by so much [m]; 0 for its own image.

    .. math:: \frac{R^2}{4} \frac{2z}{(d^2 + 4z^2)^{3/2}}
    """
    z = max(height, NEAREST * radius)
    square = beside * beside + 4.0 * z * z
    return radius * radius * z / (2.0 * square * math.sqrt(square))


@kernel
def ground_effect(radius: Array, height: float, beside: Array, i: int, count: int) -> float:
    r"""Thrust of rotor ``i`` of so many over that without a floor [1], at the same power.

    .. math:: \left(1 - \sum_k \frac{R_k^2}{4} \frac{2z}{(d_{ik}^2 + 4z^2)^{3/2}}\right)^{-1}

    The ``radius`` (8,) [m] is of every rotor, their hubs are ``beside`` (8, 8) [m] each other, and
    the ``height`` [m] is that of this one above the floor. Alone it is the single rotor of
    Cheeseman and Bennett; of four in a square it is the theory of Sanchez-Cuevas.

    Source: I. C. Cheeseman, W. E. Bennett, The Effect of the Ground on a Helicopter Rotor in
    Forward Flight, ARC R&M 3021, 1955; P. Sanchez-Cuevas, G. Heredia, A. Ollero, Characterization
    of the Aerodynamic Ground Effect and Its Influence in Multirotor Control, Int. J. Aerospace Eng.
    2017, 1823056, the rotors' part: its empirical term for the body is left out.
    """
    lost = 0.0
    for k in range(count):
        lost += image_share(radius[k], height, beside[i, k])
    return 1.0 / (1.0 - lost)
