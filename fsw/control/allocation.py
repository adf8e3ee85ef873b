"""From torque and thrust to four rotors, roll and pitch first."""

from __future__ import annotations

from fsw.compiled import compilable
from fsw.geometry.vectors import clamp, clamp_magnitude
from fsw.model.airframe import Airframe
from fsw.signals import Vec3, Vec4


@compilable
def allocate(airframe: Airframe, torque: Vec3, thrust: float, yaw_limit: float) -> Vec4:
    """Thrust of the rear, left, front and right rotor [N] of the '+' mixer, each within its limits.

    Body ``torque`` [N m, FRD], total ``thrust`` [N]; no rotor spends more than ``yaw_limit`` [N] on
    yaw. Roll and pitch keep the vehicle upright and decide where it accelerates, so they are
    served first. Thrust comes next: where one pair of rotors has no more room, the other one
    lifts. Yaw, which is the difference of the pairs' lifts, takes what is left.
    """
    top = airframe.rotor_thrust_max
    half = 0.5 * top
    roll = clamp_magnitude(torque[0] / (2.0 * airframe.rotor_arm), half)
    pitch = clamp_magnitude(torque[1] / (2.0 * airframe.rotor_arm), half)
    both = 0.5 * thrust  # N, one rotor of each pair
    yaw = clamp_magnitude(0.25 * torque[2] / airframe.yaw_per_thrust, yaw_limit)
    along = clamp(0.5 * both + yaw, abs(pitch), top - abs(pitch))
    across = clamp(both - along, abs(roll), top - abs(roll))
    along = clamp(both - across, abs(pitch), top - abs(pitch))
    return along - pitch, across + roll, along + pitch, across - roll
