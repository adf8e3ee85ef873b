"""A payload: a rigid body that the last link takes up and lets go of in flight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sitl.plant.aerial_manipulator import Plant, first_angle, place_bodies
from sitl.plant.integrator import Held
from sitl.plant.mass_matrix import mass_matrix
from sitl.plant.parameters import joint_axes
from sitl.plant.state import V_WB, W_WB_B
from sitl.plant.vector import V3, Array
from vehicles.description import Vehicle


class LinkBody(NamedTuple):
    """Mass, centre and inertia of the last link, in the plant's frame of it."""

    mass: float  # kg
    com: Array  # (3,) m
    inertia: Array  # (3, 3) kg·m², about the centre


def last_link(plant: Plant, vehicle: Vehicle) -> LinkBody:
    """The last link of a ``vehicle`` as it is now."""
    chain, last = plant.chain, len(vehicle.joints)
    return LinkBody(float(chain.mass[last]), chain.com[last].copy(), chain.inertia[last].copy())


def with_payload(
    link: LinkBody, vehicle: Vehicle, mass: float, inertia: V3, offset: V3
) -> LinkBody:
    """The last link with a payload of a ``mass`` [kg] in one rigid body.

    Its centre is at ``offset`` [m, link] from the end-effector, along the axes in which the
    ``vehicle`` describes the link, and its principal ``inertia`` [kg·m², link] is about that centre
    and these axes.
    """
    turn = joint_axes(vehicle)[-1].T  # from the description's axes to the plant's
    centre = turn @ (np.array(vehicle.end_effector.position) + offset)
    own = turn @ np.diag(inertia) @ turn.T
    whole = link.mass + mass
    com = (link.mass * link.com + mass * centre) / whole
    parts = ((link.mass, link.com, link.inertia), (mass, centre, own))
    about = np.sum([i + m * _about(c - com) for m, c, i in parts], axis=0)
    return LinkBody(whole, com, about)


def _about(r: Array) -> Array:
    """Inertia (3, 3) [m²] of a unit mass at r (3,) [m]."""
    of_unit: Array = float(r @ r) * np.eye(3) - np.outer(r, r)
    return of_unit


def put_link(plant: Any, link: LinkBody, joints: int) -> None:
    """Give the plant's record, or records, another last link."""
    chain = plant["chain"]
    chain["mass"][..., joints] = link.mass
    chain["com"][..., joints, :] = link.com
    chain["inertia"][..., joints, :, :] = link.inertia


def take_up(
    plant: Plant, blocks: Sequence[Held], state: Array, link: LinkBody, joints: int
) -> None:
    r"""Exchange the last link for one with a payload that was at rest, in a state (n,) [SI].

    In place, and in the ``plant``. An impulse acts between link and payload, as in an inelastic
    impact: momentum is kept, kinetic energy is lost.

    .. math:: M' v^+ = M v^- + J^T m v_{payload} = M v^-

    with the velocities v of base, in B, and joints. A joint that is locked stays at rest; of
    ``blocks`` there is one, for memory.
    """
    work, rates = blocks[0].memory.work, state[first_angle(plant) + joints :]
    place_bodies(plant, state, work)
    before = np.concatenate(
        [work.rotation.T @ state[V_WB : V_WB + 3], state[W_WB_B : W_WB_B + 3], rates]
    )
    momentum = mass_matrix(plant.chain, work.posture, plant.gears.carried, work.mass) @ before
    put_link(plant, link, joints)
    place_bodies(plant, state, work)
    mass = mass_matrix(plant.chain, work.posture, plant.gears.carried, work.mass)
    free = [k for k in range(6 + joints) if k < 6 or not plant.locked[k - 6] > 0.0]
    after = np.zeros(6 + joints)
    after[free] = np.linalg.solve(mass[np.ix_(free, free)], momentum[free])
    state[V_WB : V_WB + 3] = work.rotation @ after[:3]
    state[W_WB_B : W_WB_B + 3] = after[3:6]
    rates[:] = after[6:]
