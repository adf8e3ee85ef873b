"""Drag of the rotors, linear in the speed through the air."""

from __future__ import annotations

from sitl.compiled import kernel
from sitl.plant.vector import V3, Array


@kernel
def rotor_drag(drag: Array, v: V3) -> V3:
    r"""Force [N, B] at a velocity v [m/s, B] through the air, with ``drag`` (3,) [N·s/m].

    Blade flapping and the induced drag of rotors that turn at nearly constant speed:

    .. math:: f = -m \operatorname{diag}(d_x, d_y, d_z) \, R^T (v - v_{air})

    Source: M. Faessler, A. Franchi, D. Scaramuzza, Differential Flatness of Quadrotor Dynamics
    Subject to Rotor Drag, IEEE RA-L 3 (2018) 620, eq 2.
    """
    return (-drag[0] * v[0], -drag[1] * v[1], -drag[2] * v[2])
