"""Position servos of the joints, for an autopilot that commands angles and no torques.

Each has an encoder of its own and closes its loop at every step. A command of -1…1 is the joint's
range, 0 its zero; the reference moves there no faster than the servo turns, and never to where the
end stops would push it back.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sitl.plant.aerial_manipulator import place_bodies
from sitl.plant.integrator import held
from sitl.plant.mass_matrix import mass_matrix_into
from sitl.plant.parameters import Effects, plant
from sitl.plant.state import at_rest
from vehicles.description import Vehicle

_SPEED: Final = 0.6  # of a joint's rate without load
_ACCELERATION: Final = 20.0  # rad/s²; the arm's links throw each other less than that
_BANDWIDTH: Final = 25.0  # rad/s, of the closed loop


class PositionServos:
    """The servos of one vehicle; what they want of the drives is a share of full torque."""

    def __init__(
        self, vehicle: Vehicle, effects: Effects, angles: tuple[float, ...], step_s: float
    ) -> None:
        """Begin with joints at ``angles`` (j,) [rad]; a step takes ``step_s``."""
        self._step_s = step_s
        self._vehicle = vehicle
        self._full = [joint.torque_max for joint in vehicle.joints]
        self._inertia = _inertias(vehicle, effects)
        self._begin(angles)

    def _begin(self, angles: tuple[float, ...]) -> None:
        self._reference = list(angles)  # rad
        self._speed = [0.0] * len(angles)  # rad/s, of the reference
        self._held = [0.0] * len(angles)  # N·m, against weight and friction

    def torques(
        self,
        commands: tuple[float, ...],
        angles: tuple[float, ...],
        rates: tuple[float, ...],
        *,
        powered: bool,
    ) -> tuple[float, ...]:
        """Share [1] of full torque for each joint in this step.

        ``commands`` (j,) [1] say where to; ``angles`` (j,) [rad] and ``rates`` (j,) [rad/s] are the
        encoders'. A servo that is not ``powered`` is limp, and begins where it is then.
        """
        if not powered:
            self._begin(angles)
            return (0.0,) * len(angles)
        shares = []
        for k, target in enumerate(targets(self._vehicle, commands)):
            fastest = _SPEED * self._vehicle.joints[k].rate_max
            speed = self._profile(target - self._reference[k], self._speed[k], fastest)
            self._speed[k] = speed
            self._reference[k] += speed * self._step_s
            error = self._reference[k] - angles[k]
            stiffness = self._inertia[k] * _BANDWIDTH**2
            damping = 2.0 * self._inertia[k] * _BANDWIDTH
            held = self._held[k] + 0.3 * _BANDWIDTH * stiffness * error * self._step_s
            torque = stiffness * error + damping * (speed - rates[k]) + held
            # What the drive cannot give is not wound up.
            if abs(torque) <= self._full[k]:
                self._held[k] = held
            shares.append(min(max(torque / self._full[k], -1.0), 1.0))
        return tuple(shares)

    def _profile(self, left: float, speed: float, fastest: float) -> float:
        """Speed [rad/s] of a reference that has ``left`` [rad] to go and moves at ``speed``.

        It never moves faster than ``fastest`` [rad/s].
        """
        step_s = self._step_s
        # From which it still comes to rest where it should, at the end of a step.
        stopping = math.sqrt(2.0 * _ACCELERATION * abs(left))
        wanted = math.copysign(min(fastest, stopping, abs(left) / step_s), left)
        most = _ACCELERATION * step_s
        return min(max(wanted, speed - most), speed + most)


def ranges(vehicle: Vehicle) -> list[tuple[float, float]]:
    """Angles [rad] of every joint for the commands -1 and 1, the others at zero."""
    return [_within(vehicle, k, [0.0] * k) for k in range(len(vehicle.joints))]


def targets(vehicle: Vehicle, commands: tuple[float, ...]) -> list[float]:
    """Angles [rad] for commands (j,) [1], so that the joints up to each one keep their limits."""
    found: list[float] = []
    for (least, most), command in zip(ranges(vehicle), commands, strict=True):
        share = min(max(command, -1.0), 1.0)
        low, high = _within(vehicle, len(found), found)
        found.append(min(max(share * most if share >= 0.0 else -share * least, low), high))
    return found


def _within(vehicle: Vehicle, k: int, before: list[float]) -> tuple[float, float]:
    """Least and most [rad] of joint ``k``, with those ``before`` (k,) [rad] it, the rest at zero.

    A joint without limits turns half around.
    """
    joint = vehicle.joints[k]
    least, most = max(joint.position_min, -math.pi), min(joint.position_max, math.pi)
    for limit in vehicle.coupled_limits:
        share = limit.row[k]
        if share != 0.0:
            there = sum(a * b for a, b in zip(limit.row, before, strict=False))
            ends = sorted([(limit.minimum - there) / share, (limit.maximum - there) / share])
            least, most = max(least, ends[0]), min(most, ends[1])
    return least, most


def _inertias(vehicle: Vehicle, effects: Effects) -> list[float]:
    """What each joint feels of all that is behind it while all are at zero [kg·m²]."""
    numbers, work, joints = plant(vehicle, effects), held()[0].memory.work, len(vehicle.joints)
    place_bodies(numbers, at_rest(len(vehicle.rotors), joints), work)
    mass_matrix_into(numbers.chain, work.posture, work.mass)
    found: list[float] = (np.diag(work.mass)[6:] + numbers.gears.inertia)[:joints].tolist()
    return found
