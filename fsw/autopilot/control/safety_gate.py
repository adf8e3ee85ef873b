"""The last law before the actuators: finite, within limits, and nothing while disarmed."""

from __future__ import annotations

import math

from fsw.autopilot.geometry.vectors import clamp, clamp_magnitude
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import STOPPED, ActuatorCommand


def gate(
    airframe: Airframe, command: ActuatorCommand, last: ActuatorCommand, armed: bool
) -> tuple[ActuatorCommand, bool]:
    """What may be sent, and whether the last command replaces one that was not finite."""
    if not armed:
        return STOPPED, False
    (f1, f2, f3, f4), (t1, t2) = command
    top, bound = airframe.rotor_thrust_max, airframe.joint_torque_max[0]
    # What is within limits is finite as well: no comparison with NaN is true.
    if (
        (0.0 <= f1 <= top and 0.0 <= f2 <= top and 0.0 <= f3 <= top and 0.0 <= f4 <= top)
        and -bound <= t1 <= bound
        and -bound <= t2 <= bound
    ):
        return command, False
    if not math.isfinite(f1 + f2 + f3 + f4 + t1 + t2):
        return last, True
    f1, f2, f3, f4 = (clamp(thrust, 0.0, top) for thrust in command.rotor_thrust)
    t1, t2 = (clamp_magnitude(torque, bound) for torque in command.joint_torque)
    return ActuatorCommand((f1, f2, f3, f4), (t1, t2)), False
