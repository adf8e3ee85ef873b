"""Rotor thrusts and joint torques that hold a pose still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sitl.plant.bodies import empty_posture, posture_into
from sitl.plant.newton_euler import wrench_needed_into
from sitl.plant.packing import pack_params
from sitl.plant.parameters import GRAVITY, chain, effectiveness
from sitl.plant.vector import V3
from vehicles.description import Vehicle

_LEFT = 1e-9  # of the weight, what rotors may leave of a wrench


@dataclass(frozen=True, slots=True)
class Trim:
    """Actuator values of a static equilibrium."""

    thrust: tuple[float, ...]  # (r,) N
    torque: tuple[float, ...]  # (j,) N·m


class NoTrimError(ValueError):
    """The pose cannot be held within the actuators' limits."""


def level_hover(vehicle: Vehicle, angles: tuple[float, ...]) -> Trim:
    """Equilibrium of a level hover with the arm at ``angles`` [rad], at the least thrust squared.

    Raises:
        NoTrimError: A rotor or a joint would have to exceed its limit.
    """
    # As the plant has them: for others its kernels would be compiled anew.
    bodies, posture = pack_params(chain(vehicle)), pack_params(empty_posture())
    needed, zeros, still = np.empty(6 + len(angles)), np.zeros(len(angles)), (0.0, 0.0, 0.0)
    posture_into(bodies, np.array(angles), 0, posture)
    up = (0.0, 0.0, -GRAVITY)
    wrench_needed_into(bodies, posture, still, still, up, zeros, zeros, needed)
    effect = effectiveness(vehicle)
    thrusts = np.linalg.pinv(effect) @ needed[:6]
    left = np.abs(effect @ thrusts - needed[:6]).max()
    if not (left <= _LEFT * vehicle.mass * GRAVITY):
        raise NoTrimError(f"the rotors cannot hold the base level: {left:.2f} N or N·m are left")
    for number, (thrust, rotor) in enumerate(zip(thrusts, vehicle.rotors, strict=True), start=1):
        if not (-_LEFT <= thrust <= rotor.thrust_max):
            raise NoTrimError(
                f"rotor {number} would need {thrust:.2f} N to hover, "
                f"it can give 0 to {rotor.thrust_max:.2f} N"
            )
    for torque, joint in zip(needed[6:], vehicle.joints, strict=True):
        if not (abs(torque) <= joint.torque_max):
            raise NoTrimError(
                f"joint {joint.name} would need {torque:.3f} N·m to hold the arm, it can give "
                f"±{joint.torque_max:.3f} N·m; choose a posture that takes less"
            )
    return Trim(tuple(np.maximum(thrusts, 0.0).tolist()), tuple(needed[6:].tolist()))


def standing_height(vehicle: Vehicle) -> float:
    """Height of the base above ground at which the feet carry the vehicle [m]."""
    feet = vehicle.feet
    depth = vehicle.mass * GRAVITY / (len(feet.positions) * feet.stiffness)
    return max(z for _, _, z in feet.positions) - depth


def end_effector(vehicle: Vehicle, angles: tuple[float, ...]) -> V3:
    """End-effector in B [m] with the joints at ``angles`` (j,) [rad]."""
    posture = pack_params(empty_posture())
    posture_into(pack_params(chain(vehicle)), np.array(angles), 0, posture)
    x, y, z = posture.origin[len(angles) + 1].tolist()
    return (x, y, z)
