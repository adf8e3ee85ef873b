"""What a vehicle can do, by its mass, its rotors and its drives alone: no controller is asked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from fsw.autopilot.control.actuator_watch import UNDONE, torques_by_friction
from fsw.autopilot.control.tube import base_reach, limits_used
from fsw.autopilot.model.airframe import GRAVITY, airframe_of, wrench_of
from fsw.autopilot.model.multibody import Bodies, bodies_of, posture
from fsw.autopilot.parameters.carrying import payload_range
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import FlightConfig, of_vehicle
from vehicles.description import Vehicle

Array = NDArray[np.float64]
_POSTURES: Final = 400  # that are drawn within the limits
_HOVER_MOST: Final = 0.8  # of full thrust
_YAW, _THRUST = 2, 3  # rows of the effectiveness
AXES: Final = ("roll", "pitch", "yaw")


@dataclass(frozen=True, slots=True)
class Figures:
    """Of a vehicle at its rest posture, in still air."""

    mass: float  # kg
    arm_mass: float  # kg
    hover_throttle: float  # share of its full thrust that the hardest working rotor gives; inf
    thrust_to_weight: float  # of the most that is lifted without a torque
    authority: dict[str, float]  # rad/s^2 in hover to the weaker side, by axis
    reach: float  # m, from the body's origin to the end-effector at most
    joint_load: tuple[float, ...]  # N m, most that each drive holds of its own arm, at rest
    joint_torque: tuple[float, ...]  # N m, most that it gives


def figures(vehicle: Vehicle) -> Figures:
    """Work out what a vehicle can do."""
    bodies = bodies_of(vehicle)
    m = posture(bodies, vehicle.rest_posture)
    weight = vehicle.mass * GRAVITY
    effect = _effectiveness(vehicle, np.array(m.centre))
    top = np.array([rotor.thrust_max for rotor in vehicle.rotors])
    level = np.array([0.0, 0.0, 0.0, weight])
    angular = np.array(m.inverse).reshape(3, 3)
    loads = [_loads(bodies, q) for q in _postures(vehicle)]
    return Figures(
        mass=vehicle.mass,
        arm_mass=vehicle.mass - vehicle.base.mass,
        hover_throttle=_throttle(effect, top, level),
        thrust_to_weight=_most(effect, top, effect[_THRUST], [0, 1, 2], np.zeros(3)) / weight,
        authority={
            name: _authority(effect, top, level, angular[k, k], k) for k, name in enumerate(AXES)
        },
        reach=_reach(vehicle),
        joint_load=tuple(np.max(np.abs(loads), axis=0).tolist()),
        joint_torque=tuple(joint.torque_max for joint in vehicle.joints),
    )


def start_up(vehicle: Vehicle) -> str:
    """What the flight software's analysis says at start with its default loops, in a sentence."""
    config = of_vehicle(FlightConfig(), vehicle)
    airframe = config.airframe
    pushed, loop = config.surroundings.disturbance, loop_tube(config)
    used = limits_used(airframe, config.tuning.tracking, loop, pushed)
    most = max(used, key=lambda name: used[name])
    reach = base_reach(loop, config.surroundings.disturbance)
    payload = payload_range(config, loop)
    return (
        f"the base stays within {1e3 * reach:.0f} mm of its plan under {pushed:g} m/s^2, "
        f"which takes {100.0 * used[most]:.0f} % of {most}; it may carry "
        f"{1e3 * payload.most:.0f} g, bounded by {payload.by}"
    )


def warnings(vehicle: Vehicle, found: Figures) -> list[str]:
    """What makes a vehicle hard or impossible to fly, a sentence each."""
    told = []
    if found.hover_throttle > 1.0:
        told.append(
            "it cannot hover: its rotors cannot carry it and balance its arm; give them more thrust"
        )
    elif found.hover_throttle > _HOVER_MOST:
        told.append(
            f"it hovers at {100.0 * found.hover_throttle:.0f} % of a rotor's thrust: above "
            f"{100.0 * _HOVER_MOST:.0f} % little is left to turn with"
        )
    told += [
        f"it has no authority about {name} in hover" for name, most in found.authority.items()
        if not most > 1e-3
    ]  # fmt: skip
    for joint, load, most in zip(vehicle.joints, found.joint_load, found.joint_torque, strict=True):
        if load > most:
            told.append(
                f"joint {joint.name} cannot hold its own arm: that takes {load:.3g} N m in some "
                f"posture, torque_max is {most:.3g} N m"
            )
    scales = torques_by_friction(airframe_of(vehicle))
    for joint, scale in zip(vehicle.joints, scales, strict=False):
        if scale * UNDONE > joint.torque_max:
            told.append(
                f"a drive of joint {joint.name} that fails is not found: friction takes up to "
                f"{joint.coulomb + joint.viscous * joint.rate_max:.3g} N m, and torque_max is "
                f"{joint.torque_max:.3g} N m"
            )
    sideways = [i for i, rotor in enumerate(vehicle.rotors) if rotor.axis[2] > -0.999]
    if sideways:
        numbers = ", ".join(f"{i + 1}" for i in sideways)
        told.append(f"lateral thrust of tilted rotors is not used: {numbers}")
    return told


def _effectiveness(vehicle: Vehicle, centre: Array) -> Array:
    """Roll, pitch, yaw about the centre of mass and thrust along -z, of a newton of each rotor."""
    rows = np.array([wrench_of(rotor) for rotor in vehicle.rotors])
    torque = rows[:, 3:] - np.cross(centre, rows[:, :3])
    return np.column_stack((torque, -rows[:, 2])).T


def _throttle(effect: Array, top: Array, wish: Array) -> float:
    """Least share of its full thrust that no rotor has to exceed for a wish."""
    n = len(top)
    # Unknown: thrusts and the share.
    rows = np.column_stack((np.eye(n), -top))
    equal = np.column_stack((effect, np.zeros(4)))
    found = linprog(
        np.append(np.zeros(n), 1.0), rows, np.zeros(n), equal, wish, bounds=[(0.0, None)] * (n + 1)
    )
    return float(found.fun) if found.success else math.inf


def _most(effect: Array, top: Array, along: Array, kept: Sequence[int], values: Array) -> float:
    """The most of a row that rotors give while others are ``values``; 0 if they cannot be."""
    bounds = [(0.0, float(most)) for most in top]
    found = linprog(-along, A_eq=effect[list(kept)], b_eq=values, bounds=bounds)
    return float(-found.fun) if found.success else 0.0


def _authority(effect: Array, top: Array, level: Array, per_torque: float, axis: int) -> float:
    """Angular acceleration [rad/s^2] about an axis in hover, to the weaker side.

    Yaw is what allocation gives up: of roll and pitch it is what is left when yaw may be anything.
    """
    kept = [row for row in range(4) if row != axis and (row != _YAW or axis == _YAW)]
    sides = [_most(effect, top, sign * effect[axis], kept, level[kept]) for sign in (1.0, -1.0)]
    return max(min(sides), 0.0) * per_torque


def _postures(vehicle: Vehicle) -> list[tuple[float, ...]]:
    """Postures within all limits, the rest posture among them."""
    low = np.array([max(joint.position_min, -math.pi) for joint in vehicle.joints])
    high = np.array([min(joint.position_max, math.pi) for joint in vehicle.joints])
    random = np.random.default_rng(0)
    drawn = random.uniform(low, high, (_POSTURES, len(low)))
    for limit in vehicle.coupled_limits:
        angle = drawn @ limit.row
        drawn = drawn[(angle >= limit.minimum) & (angle <= limit.maximum)]
    return [vehicle.rest_posture, *(tuple(q.tolist()) for q in drawn)]


def _loads(bodies: Bodies, q: tuple[float, ...]) -> Array:
    """Torques [N m] that hold the arm of a level vehicle in hover."""
    m = posture(bodies, q)
    return -GRAVITY * np.array(m.vq).reshape(-1, 3)[: bodies.joints, 2]


def _reach(vehicle: Vehicle) -> float:
    places = [joint.xyz for joint in vehicle.joints] + [vehicle.end_effector.position]
    return sum(math.hypot(*place) for place in places)
