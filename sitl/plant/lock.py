"""A joint that seizes: it stops at once, and the rest of the vehicle takes up its momentum."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sitl.plant.aerial_manipulator import Plant, first_angle, place_bodies
from sitl.plant.integrator import Held
from sitl.plant.mass_matrix import mass_matrix
from sitl.plant.state import V_WB, W_WB_B
from sitl.plant.vector import Array


def seize(plant: Plant, blocks: Sequence[Held], state: Array, locked: tuple[bool, ...]) -> None:
    r"""Stop the joints that are ``locked`` [1], in a state (n,) [SI], in place.

    An impulse acts between the links of each such joint and nothing else does, as in an inelastic
    impact: momentum is kept, kinetic energy is lost and never gained. Of ``blocks`` there is one,
    for memory.

    .. math:: M (v^+ - v^-) = \sum_i e_i λ_i, \quad v_i^+ = 0

    with the velocities v of base, in B, and joints, and the motors' inertia in M.
    """
    joints, work = len(locked), blocks[0].memory.work
    rates = state[first_angle(plant) + joints :]
    stop = [6 + i for i in range(joints) if locked[i]]
    free = [k for k in range(6 + joints) if k not in stop]
    place_bodies(plant, state, work)
    mass = mass_matrix(plant.chain, work.posture, plant.gears.carried, work.mass)
    stopped = rates[[k - 6 for k in stop]].copy()
    change = np.zeros(6 + joints)
    change[free] = np.linalg.solve(mass[np.ix_(free, free)], mass[np.ix_(free, stop)] @ stopped)
    change[stop] = -stopped
    state[V_WB : V_WB + 3] += work.rotation @ change[:3]
    state[W_WB_B : W_WB_B + 3] += change[3:6]
    rates += change[6:]
    rates[[k - 6 for k in stop]] = 0.0  # and not almost
