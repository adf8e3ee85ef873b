"""How fast friction, end stops and surfaces can move a vehicle, beside what a step can follow."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np

from sitl.plant.actuators import SLOW
from sitl.plant.aerial_manipulator import Plant, Workspace, empty_workspace, place_bodies
from sitl.plant.contact import SLIP_RATE
from sitl.plant.mass_matrix import mass_matrix
from sitl.plant.packing import pack_params
from sitl.plant.parameters import GRAVITY, Effects, Surface, plant
from sitl.plant.state import THRUST, at_rest
from sitl.plant.vector import Array
from vehicles.description import Vehicle

FASTEST = 2500.0  # 1/s; at 2785 a step of 1 ms is no longer stable
STEPS_MAX = 20  # of 50 µs
_POSTURES = 64
_MIN_ARMATURE: Final = 1e-5  # kg m^2, that a joint is given
_LESS: Final = 0.8  # of a stiffness, at each try
_MAX_SLIP: Final = 0.5  # m/s
_REMEDIES = (
    (
        "the joints' friction",
        "divide joints.coulomb and viscous by {:.2g}, or give the joints more armature",
    ),
    (
        "end_stops",
        "divide their stiffness and damping by {:.2g}, or give the joints more armature",
    ),
    ("feet", "divide feet.stiffness by {0:.2g} and multiply feet.slip_rate by it"),
)


class TooStiffError(ValueError):
    """Joints that a step of the plant cannot follow; the message says what to change."""


def check_stiffness(vehicle: Vehicle, effects: Effects) -> None:
    """Refuse a vehicle whose arm the plant could not integrate.

    Raises:
        TooStiffError: Friction or end stops are too strong for the inertia of the arm.
    """
    for rate, (what, remedy) in zip(
        fastest_rates(vehicle, effects.motor_inertia), _REMEDIES, strict=True
    ):
        if not (rate <= FASTEST):
            raise TooStiffError(
                f"vehicle {vehicle.name}: {what} would move it at {rate:.0f} 1/s, a step of the "
                f"plant follows {FASTEST:.0f}; {remedy.format(rate / FASTEST)}"
            )


def soften(vehicle: Vehicle) -> tuple[Vehicle, list[str]]:
    """The vehicle as a step of the plant can follow it, and what that takes, a sentence each.

    For files that say nothing of what is stiff: a URDF knows no inertia of motors, which is what
    slows a small link down, and neither end stops nor feet.
    """
    told: list[str] = []
    armature = 0.0
    while fastest_rates(vehicle, armature)[0] > FASTEST:
        armature = max(2.0 * armature, _MIN_ARMATURE)
    if armature > 0.0:
        joints = tuple(replace(one, armature=one.armature + armature) for one in vehicle.joints)
        vehicle = replace(vehicle, joints=joints)
        told.append(
            f"each joint's motor is given an armature of {armature:.2g} kg m^2, or friction would "
            "stop it quicker than a step of the simulator: put in the real one"
        )
    stops, feet = vehicle.end_stops, vehicle.feet
    while fastest_rates(vehicle)[1] > FASTEST:
        stops = replace(stops, stiffness=_LESS * stops.stiffness, damping=_LESS * stops.damping)
        vehicle = replace(vehicle, end_stops=stops)
    while fastest_rates(vehicle)[2] > FASTEST and feet.slip_rate < _MAX_SLIP:
        feet = replace(feet, stiffness=_LESS * feet.stiffness, slip_rate=feet.slip_rate / _LESS)
        vehicle = replace(vehicle, feet=feet)
    return vehicle, told


@lru_cache(maxsize=16)
def fastest_rates(vehicle: Vehicle, motor_inertia: float = 0.0) -> tuple[float, float, float]:
    r"""Fastest eigenvalue of the joints about zero rate, at their stops, and of feet [1/s].

    .. math:: \ddot x = -A (D \dot x + K x), \quad A = (M^{-1})_{xx}

    Of the joints over postures within the limits; Coulomb's friction is steep about zero rate only,
    and every stop is touched at once. Each joint carries a ``motor_inertia`` [kg·m²] beside its
    armature. The vehicle stands on all feet in its posture of rest.
    """
    numbers = plant(vehicle, Effects(motor_inertia=motor_inertia))
    work = pack_params(empty_workspace())
    joints, arm = len(vehicle.joints), THRUST + len(vehicle.rotors)
    state, stops = at_rest(len(vehicle.rotors), joints), numbers.stops
    there = np.isfinite(stops.most) | np.isfinite(stops.least)
    touched = stops.share[: stops.number][there[: stops.number], :joints]
    viscous = np.diag([one.viscous for one in vehicle.joints])
    friction = viscous + np.diag([one.coulomb / SLOW for one in vehicle.joints])
    damping = viscous + stops.damping * touched.T @ touched
    stiffness = stops.stiffness * touched.T @ touched
    worst, mobility = [0.0, 0.0], np.eye(6 + joints)
    for angles in _postures(vehicle):
        state[arm : arm + joints] = angles
        mobility[:] = _mobility(numbers, state, work)
        of_joints = mobility[6:, 6:]
        worst[0] = max(worst[0], _fastest(of_joints, friction, np.zeros_like(friction)))
        worst[1] = max(worst[1], _fastest(of_joints, damping, stiffness))
    return worst[0], worst[1], _fastest(mobility[:6, :6], *_of_feet(vehicle))


@lru_cache(maxsize=16)
def steps_of_touch(
    vehicle: Vehicle, surfaces: tuple[Surface, ...], force: float, motor_inertia: float = 0.0
) -> int:
    """Into how many steps one of the plant is divided where the tip touches one of the surfaces.

    They press on it with up to ``force`` [N]; joints carry a ``motor_inertia`` [kg·m²].

    Raises:
        TooStiffError: Into more than the plant has time for.
    """
    numbers = plant(vehicle, Effects(motor_inertia=motor_inertia))
    work = pack_params(empty_workspace())
    state, last = at_rest(len(vehicle.rotors), len(vehicle.joints)), len(vehicle.joints)
    arm, fastest = THRUST + len(vehicle.rotors), 0.0
    for angles in _postures(vehicle):
        state[arm : arm + last] = angles
        mobility = _mobility(numbers, state, work)
        x, y, z = work.posture.origin[last + 1]
        to_tip = np.zeros((3, 6 + last))
        to_tip[:, :6] = [[1, 0, 0, 0, z, -y], [0, 1, 0, -z, 0, x], [0, 0, 1, y, -x, 0]]
        for i in range(1, last + 1):
            lever = work.posture.origin[last + 1] - work.posture.origin[i]
            to_tip[:, 5 + i] = np.cross(work.posture.axes[i, :, 2], lever)
        of_tip = float(np.linalg.eigvalsh(to_tip @ mobility @ to_tip.T)[-1])
        for one in surfaces:
            braked = max(one.friction / SLIP_RATE, one.dissipation) * force
            row = np.array([[of_tip]]), np.array([[braked]]), np.array([[one.stiffness]])
            fastest = max(fastest, _fastest(*row))
    steps = math.ceil(fastest / FASTEST)
    if steps > STEPS_MAX:
        raise TooStiffError(
            f"vehicle {vehicle.name}: surfaces would move its tip at {fastest:.0f} 1/s, the plant "
            f"follows {STEPS_MAX * FASTEST:.0f}; lower stiffness, friction or force_max of "
            "zones.touch, or give the joints more armature"
        )
    return max(steps, 1)


def _postures(vehicle: Vehicle) -> list[Array]:
    """Angles (j,) [rad] all over the limits, the posture of rest last."""
    joints = len(vehicle.joints)
    least = np.array([max(one.position_min, -math.pi) for one in vehicle.joints])
    most = np.array([min(one.position_max, math.pi) for one in vehicle.joints])
    shares = np.random.default_rng(0).uniform(size=(_POSTURES, joints))
    ends = [np.array(vehicle.home_posture), np.array(vehicle.rest_posture)]
    return [*(least + shares * (most - least)), *ends]


def _mobility(numbers: Plant, state: Array, work: Workspace) -> Array:
    """Inverse of the mass matrix (6 + j, 6 + j) [SI] at a state (n,) [SI], which it places."""
    place_bodies(numbers, state, work)
    mass = mass_matrix(numbers.chain, work.posture, numbers.gears.inertia, work.mass)
    inverse: Array = np.array(np.linalg.inv(mass), dtype=float)
    return inverse


def _of_feet(vehicle: Vehicle) -> tuple[Array, Array]:
    """Damping and stiffness (6, 6) [SI] of a base that stands on all its feet."""
    feet, damping, stiffness = vehicle.feet, np.zeros((6, 6)), np.zeros((6, 6))
    load = vehicle.mass * GRAVITY / len(feet.positions)  # N, on each
    slip = feet.friction * load / feet.slip_rate
    for x, y, z in feet.positions:
        to_foot = np.array([[1, 0, 0, 0, z, -y], [0, 1, 0, -z, 0, x], [0, 0, 1, y, -x, 0]])
        damping += to_foot.T @ np.diag([slip, slip, feet.dissipation * load]) @ to_foot
        stiffness += to_foot.T @ np.diag([0.0, 0.0, feet.stiffness]) @ to_foot
    return damping, stiffness


def _fastest(mobility: Array, damping: Array, stiffness: Array) -> float:
    """Largest eigenvalue [1/s] of motion with a mobility, damping and stiffness (n, n) [SI]."""
    n = len(mobility)
    rates = np.block([[np.zeros((n, n)), np.eye(n)], [-mobility @ stiffness, -mobility @ damping]])
    return float(np.abs(np.linalg.eigvals(rates)).max())
