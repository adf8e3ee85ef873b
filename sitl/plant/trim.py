"""Rotor thrusts and joint torques that hold a pose still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sitl.plant.bodies import empty_posture, posture_into
from sitl.plant.newton_euler import wrench_needed_into
from sitl.plant.parameters import Vehicle, chain


@dataclass(frozen=True, slots=True)
class Trim:
    """Actuator values of a static equilibrium."""

    thrust: tuple[float, float, float, float]  # N, rotors 1..4
    torque: tuple[float, ...]  # (j,) N·m


class NoTrimError(ValueError):
    """The pose cannot be held within the actuators' limits."""


def level_hover(vehicle: Vehicle, angles: tuple[float, ...]) -> Trim:
    """Equilibrium of a level hover with the arm at ``angles`` [rad].

    Raises:
        NoTrimError: A rotor or a joint would have to exceed its limit.
    """
    joints = len(angles)
    posture = empty_posture(joints)
    bodies = chain(vehicle)
    posture_into(bodies, np.array(angles), posture)
    needed, zeros = np.empty(6 + joints), np.zeros(joints)
    up = (0.0, 0.0, -vehicle.gravity)
    still = (0.0, 0.0, 0.0)
    wrench_needed_into(bodies, posture, still, still, up, zeros, zeros, needed)
    rotors = vehicle.rotors
    arm, ratio = rotors.arm, rotors.yaw_ratio
    mixer = np.array(
        [
            [-1.0, -1.0, -1.0, -1.0],
            [0.0, arm, 0.0, -arm],
            [-arm, 0.0, arm, 0.0],
            [ratio, -ratio, ratio, -ratio],
        ]
    )
    f1, f2, f3, f4 = (float(f) for f in np.linalg.solve(mixer, needed[2:6]))
    torque = tuple(float(t) for t in needed[6:])
    for number, thrust in enumerate((f1, f2, f3, f4), start=1):
        if not (0.0 <= thrust <= rotors.thrust_max):
            raise NoTrimError(
                f"rotor {number} would need {thrust:.2f} N to hover, "
                f"it can give 0 to {rotors.thrust_max:.2f} N"
            )
    for number, value in enumerate(torque, start=1):
        if not (abs(value) <= vehicle.joints.torque_max):
            raise NoTrimError(
                f"joint {number} would need {value:.3f} N·m to hold the arm, "
                f"it can give ±{vehicle.joints.torque_max:.3f} N·m"
            )
    return Trim(thrust=(f1, f2, f3, f4), torque=torque)


def standing_height(vehicle: Vehicle) -> float:
    """Height of the base above ground at which the legs carry the vehicle [m]."""
    legs = vehicle.legs
    depth = vehicle.mass * vehicle.gravity / (4.0 * legs.stiffness)
    return legs.length - depth
