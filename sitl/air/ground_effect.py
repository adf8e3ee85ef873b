"""More thrust near a floor: every rotor is a source, and the floor its mirror."""

from __future__ import annotations

import math

from sitl.compiled import kernel

NEAREST = 0.5  # rotor radii; nearer, the theory has no answer


@kernel
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
def ground_effect(radius: float, height: float, arm: float) -> float:
    r"""Thrust of one of four rotors over that without a floor [1], at the same power.

    .. math:: \frac{1}{1 - (R/4z)^2 - \frac{R^2 z}{(d^2+4z^2)^{3/2}}
              - \frac{R^2 z}{2 (2d^2+4z^2)^{3/2}}}

    with the distance d between neighbours, :math:`\sqrt2` times the ``arm`` [m]. The ``radius`` [m]
    is a rotor's, the ``height`` [m] its own above the floor. With the arm endless it is the single
    rotor of Cheeseman and Bennett.

    Source: I. C. Cheeseman, W. E. Bennett, The Effect of the Ground on a Helicopter Rotor in
    Forward Flight, ARC R&M 3021, 1955; P. Sanchez-Cuevas, G. Heredia, A. Ollero, Characterization
    of the Aerodynamic Ground Effect and Its Influence in Multirotor Control, Int. J. Aerospace Eng.
    2017, 1823056, the rotors' part: its empirical term for the body is left out.
    """
    neighbour = math.sqrt(2.0) * arm
    lost = (
        image_share(radius, height, 0.0)
        + 2.0 * image_share(radius, height, neighbour)
        + image_share(radius, height, 2.0 * arm)
    )
    return 1.0 / (1.0 - lost)
