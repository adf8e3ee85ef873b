"""Position servos of the joints, for an autopilot that commands angles and no torques.

Each has an encoder of its own and closes its loop at every step. A command of -1…1 is the joint's
range; the reference moves there no faster than the servo turns, and never to where the end stops
would push it back.
"""

from __future__ import annotations

import math
from typing import Final

from sitl.limits import BOTH_JOINTS_DEG, FIRST_JOINT_DEG
from sitl.plant.parameters import Vehicle

# Angle of the first joint, and of every other one, for a command of 1.
RANGES: Final = (math.radians(FIRST_JOINT_DEG), math.radians(BOTH_JOINTS_DEG))  # rad
_SUM_MAX: Final = math.radians(BOTH_JOINTS_DEG)  # rad, of a link against the base
_SPEED: Final = 3.0  # rad/s; the limit of 5 is that of a servo without load
_ACCELERATION: Final = 20.0  # rad/s²; the arm's links throw each other less than that
_BANDWIDTH: Final = 25.0  # rad/s, of the closed loop


class PositionServos:
    """The servos of one vehicle; what they want of the drives is a share of full torque."""

    def __init__(self, vehicle: Vehicle, angles: tuple[float, ...], step_s: float) -> None:
        """Begin with joints at ``angles`` (j,) [rad]; a step takes ``step_s``."""
        self._step_s = step_s
        self._full = vehicle.joints.torque_max
        self._inertia = [
            _inertia_about(vehicle, joint) + vehicle.motors.inertia
            for joint in range(len(vehicle.links))
        ]
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
        for k, target in enumerate(_targets(commands)):
            speed = self._speed[k] = self._profile(target - self._reference[k], self._speed[k])
            self._reference[k] += speed * self._step_s
            error = self._reference[k] - angles[k]
            stiffness = self._inertia[k] * _BANDWIDTH**2
            damping = 2.0 * self._inertia[k] * _BANDWIDTH
            held = self._held[k] + 0.3 * _BANDWIDTH * stiffness * error * self._step_s
            torque = stiffness * error + damping * (speed - rates[k]) + held
            # What the drive cannot give is not wound up.
            if abs(torque) <= self._full:
                self._held[k] = held
            shares.append(min(max(torque / self._full, -1.0), 1.0))
        return tuple(shares)

    def _profile(self, left: float, speed: float) -> float:
        """Speed [rad/s] of a reference that has ``left`` [rad] to go and moves at ``speed``."""
        step_s = self._step_s
        # From which it still comes to rest where it should, at the end of a step.
        stopping = math.sqrt(2.0 * _ACCELERATION * abs(left))
        wanted = math.copysign(min(_SPEED, stopping, abs(left) / step_s), left)
        most = _ACCELERATION * step_s
        return min(max(wanted, speed - most), speed + most)


def _targets(commands: tuple[float, ...]) -> list[float]:
    """Angles [rad] for commands [1], so that no link goes beyond its limit against the base."""
    targets: list[float] = []
    total = 0.0
    for k, command in enumerate(commands):
        angle = RANGES[min(k, 1)] * min(max(command, -1.0), 1.0)
        angle = min(max(total + angle, -_SUM_MAX), _SUM_MAX) - total
        targets.append(angle)
        total += angle
    return targets


def _inertia_about(vehicle: Vehicle, joint: int) -> float:
    """What the joint feels of all links behind it while the arm is straight [kg·m²]."""
    inertia = reach = 0.0
    for link in vehicle.links[joint:]:
        distance = reach + link.a + link.com[0]
        inertia += link.inertia[2] + link.mass * distance**2
        reach += link.a
    return inertia
