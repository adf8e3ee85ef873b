"""The last law before the actuators: finite, within limits, and nothing while disarmed."""

from __future__ import annotations

import math

from fsw.geometry.vectors import clamp, clamp_magnitude
from fsw.model.airframe import Airframe
from fsw.signals import STOPPED, ActuatorCommand


def gate(
    airframe: Airframe, command: ActuatorCommand, last: ActuatorCommand, armed: bool
) -> tuple[ActuatorCommand, bool]:
    """What may be sent, and whether the last command replaces one that was not finite."""
    if not armed:
        return STOPPED, False
    if not math.isfinite(sum(command.rotor_thrust) + sum(command.joint_torque)):
        return last, True
    rotors, joints = command
    top, bound = airframe.rotor_thrust_max, airframe.joint_torque_max
    if min(rotors) >= 0.0 and max(rotors) <= top and max(map(abs, joints)) <= bound:
        return command, False
    f1, f2, f3, f4 = (clamp(thrust, 0.0, top) for thrust in rotors)
    t1, t2 = (clamp_magnitude(torque, bound) for torque in joints)
    return ActuatorCommand((f1, f2, f3, f4), (t1, t2)), False
