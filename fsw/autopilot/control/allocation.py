"""From torque and thrust to four rotors, roll and pitch first."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.geometry.vectors import clamp, clamp_magnitude
from fsw.autopilot.model.actuator_health import HEALTHY, ActuatorHealth, limits_of
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import Vec3, Vec4
from fsw.autopilot.tick_record import Health
from fsw.compiled import compilable

REAR: Final = 0
LEFT: Final = 1
FRONT: Final = 2
RIGHT: Final = 3


@compilable
def allocate(
    airframe: Airframe,
    torque: Vec3,
    thrust: float,
    yaw_limit: float,
    health: ActuatorHealth | Health = HEALTHY,
) -> Vec4:
    """Thrust of the rear, left, front and right rotor [N] of the '+' mixer, each within its limits.

    Body ``torque`` [N m, FRD], total ``thrust`` [N]; no rotor spends more than ``yaw_limit`` [N] on
    yaw. Roll and pitch keep the vehicle upright and decide where it accelerates, so they are
    served first. Thrust comes next: where one pair of rotors has no more room, the other one
    lifts. Yaw, which is the difference of the pairs' lifts, takes what is left. A rotor that is
    weak by its ``health`` has less room, and one that does not obey has none: the one opposite
    turns the vehicle alone, and yaw is what it cannot have then.
    """
    low, top = limits_of(health, airframe.rotor_thrust_max)
    roll = clamp(
        torque[0] / (2.0 * airframe.rotor_arm),
        0.5 * (low[LEFT] - top[RIGHT]),
        0.5 * (top[LEFT] - low[RIGHT]),
    )
    pitch = clamp(
        torque[1] / (2.0 * airframe.rotor_arm),
        0.5 * (low[FRONT] - top[REAR]),
        0.5 * (top[FRONT] - low[REAR]),
    )
    least_along = max(low[REAR] + pitch, low[FRONT] - pitch)
    most_along = min(top[REAR] + pitch, top[FRONT] - pitch)
    least_across = max(low[LEFT] - roll, low[RIGHT] + roll)
    most_across = min(top[LEFT] - roll, top[RIGHT] + roll)
    both = 0.5 * thrust  # N, one rotor of each pair
    yaw = clamp_magnitude(0.25 * torque[2] / airframe.yaw_per_thrust, yaw_limit)
    along = clamp(0.5 * both + yaw, least_along, most_along)
    across = clamp(both - along, least_across, most_across)
    along = clamp(both - across, least_along, most_along)
    return along - pitch, across + roll, along + pitch, across - roll
