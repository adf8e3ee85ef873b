"""A joint that seizes: it stops at once, and the rest of the vehicle takes up its momentum."""

from __future__ import annotations

import numpy as np

from sitl.plant.bodies import empty_posture, posture_into
from sitl.plant.newton_euler import wrench_needed_into
from sitl.plant.parameters import Vehicle, chain
from sitl.plant.state import ARM, Q_WB, V_WB, W_WB_B
from sitl.plant.vector import V3, Array, rotation_into

_STILL: V3 = (0.0, 0.0, 0.0)


def seize(vehicle: Vehicle, state: Array, locked: tuple[bool, ...]) -> None:
    r"""Stop the joints that are ``locked`` [1], in a state (17 + 2j,) [SI], in place.

    An impulse acts between the links of each such joint and nothing else does, as in an inelastic
    impact: momentum is kept, kinetic energy is lost and never gained.

    .. math:: M (v^+ - v^-) = \sum_i e_i λ_i, \quad v_i^+ = 0

    with the velocities v of base, in B, and joints.
    """
    joints = len(locked)
    rates = state[ARM + joints :]
    stop = [6 + i for i in range(joints) if locked[i]]
    free = [k for k in range(6 + joints) if k not in stop]
    mass = _mass_matrix(vehicle, state[ARM : ARM + joints])
    stopped = rates[[k - 6 for k in stop]].copy()
    change = np.zeros(6 + joints)
    change[free] = np.linalg.solve(mass[np.ix_(free, free)], mass[np.ix_(free, stop)] @ stopped)
    change[stop] = -stopped
    rotation = np.empty((3, 3))
    rotation_into(state, Q_WB, rotation)
    state[V_WB : V_WB + 3] += rotation @ change[:3]
    state[W_WB_B : W_WB_B + 3] += change[3:6]
    rates += change[6:]
    rates[[k - 6 for k in stop]] = 0.0  # and not almost


def _mass_matrix(vehicle: Vehicle, angles: Array) -> Array:
    """Column by column what unit accelerations need, in the units of ``mass_matrix_into``."""
    bodies, joints = chain(vehicle), len(angles)
    posture, zeros = empty_posture(joints), np.zeros(joints)
    posture_into(bodies, angles.copy(), posture)
    mass = np.empty((6 + joints, 6 + joints))
    column = np.empty(6 + joints)
    for k, one in enumerate(np.eye(6 + joints)):
        linear, turn = (one[0], one[1], one[2]), (one[3], one[4], one[5])
        wrench_needed_into(bodies, posture, _STILL, turn, linear, zeros, one[6:].copy(), column)
        mass[:, k] = column
    return mass
