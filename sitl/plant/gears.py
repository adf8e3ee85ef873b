r"""Motors behind the joints' gears: inertia that a joint has to carry, and backlash.

Behind its gear a motor has an inertia :math:`I_m`, several times that of a light link. While the
teeth touch, motor and link have one speed and :math:`I_m` adds to the joint's entry on the
diagonal of the mass matrix. Within the gap the motor is alone, :math:`I_m \dot s = \tau`, and the
link is free. Teeth can push and not pull: they part where the torque between them,
:math:`\tau - I_m \ddot\theta`, changes its sign. They meet without rebound, and momentum is kept:

.. math:: (M + \mathrm{diag}(I_m))(\dot q^+ - \dot q^-) = I_m (s - \dot\theta^-).

The motor's own part in the turning of the base is left out, as it is small: its axis turns with the
base, and its mass is part of the link before it.

Source: R. Featherstone, Rigid Body Dynamics Algorithms, section 9.6, for the inertia behind a gear;
M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash - a survey, Automatica 38
(2002) 1633, dead-zone model with a stiff, inelastic shaft.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.compiled import compilable
from sitl.plant.state import JOINTS_MAX
from sitl.plant.vector import Array


class Gears(NamedTuple):
    """Numbers and state of the gears for the kernels, an entry a joint; there is room for six."""

    joints: int
    gap: float  # rad, from one tooth to the other; 0: the teeth always touch
    inertia: Array  # (6,) kg·m², of a motor behind its gear
    carried: Array  # (6,) kg·m², what of it the joint carries now
    side: Array  # (6,) of the teeth that touch: 1 the motor is ahead, -1 behind, 0 none do
    position: Array  # (6,) rad, of the motor against the link, within ± half of the gap
    speed: Array  # (6,) rad/s, of a motor within the gap


def gears(inertia: Array, gap: float) -> Gears:
    """Motors of an ``inertia`` (j,) [kg·m²] behind gears with a ``gap`` [rad].

    With a gap they stand in its middle, at rest.
    """
    none, each = np.zeros(JOINTS_MAX), np.zeros(JOINTS_MAX)
    each[: len(inertia)] = inertia
    return Gears(len(inertia), gap, each, none if gap > 0.0 else each, none, none, none)


@compilable
def part_teeth(gears: Gears, torque: Array, acceleration: Array, rates: Array) -> bool:
    """Let go of every motor whose teeth would have to pull; whether there was one.

    ``torque`` (j,) [N·m] drives motors, and their joints turn at ``rates`` (j,) [rad/s]; the whole
    ``acceleration`` (6 + j,) [SI] is what follows if the teeth hold.
    """
    parted = False
    for i in range(gears.joints):
        between = torque[i] - gears.inertia[i] * acceleration[6 + i]
        if between * gears.side[i] < 0.0:
            gears.side[i] = 0.0
            gears.carried[i] = 0.0
            gears.speed[i] = rates[i]
            parted = True
    return parted


@compilable
def move_free(gears: Gears, torque: Array, moved: Array, rates: Array, step: float) -> bool:
    """Move the motors within their gaps for a ``step`` [s]; whether teeth have met.

    Their joints ``moved`` (j,) [rad] and now turn at ``rates`` (j,) [rad/s]; ``torque`` (j,) [N·m]
    drives them. Then ``moved`` holds the momentum [N·m·s] with which motors meet their joints.
    """
    half, met = 0.5 * gears.gap, False
    for i in range(gears.joints):
        link, moved[i] = moved[i], 0.0
        if gears.side[i] != 0.0:
            continue
        gained = step * torque[i] / gears.inertia[i]
        gears.position[i] += step * (gears.speed[i] + 0.5 * gained) - link
        gears.speed[i] += gained
        relative = gears.speed[i] - rates[i]
        if abs(gears.position[i]) >= half and relative * gears.position[i] >= 0.0:
            gears.side[i] = 1.0 if gears.position[i] > 0.0 else -1.0
            gears.position[i] = half * gears.side[i]
            gears.carried[i] = gears.inertia[i]
            moved[i] = gears.inertia[i] * relative
            met = True
    return met


@compilable
def servo_rates_into(gears: Gears, rates: Array) -> None:
    """Joints' ``rates`` (j,) [rad/s], replaced by those of motors that are within their gaps."""
    for i in range(gears.joints):
        if gears.side[i] == 0.0:
            rates[i] = gears.speed[i]
