"""The last law before the actuators: finite, within limits, and nothing while disarmed."""

from __future__ import annotations

import math

from fsw.autopilot.geometry.vectors import clamp, clamp_magnitude
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import ActuatorCommand


def stopped(airframe: Airframe) -> ActuatorCommand:
    """The command under which nothing moves."""
    return ActuatorCommand((0.0,) * airframe.rotors, (0.0,) * airframe.bodies.joints)


def gate(
    airframe: Airframe, command: ActuatorCommand, last: ActuatorCommand, armed: bool
) -> tuple[ActuatorCommand, bool]:
    """What may be sent, and whether the last command replaces one that was not finite."""
    if not armed:
        return stopped(airframe), False
    top, bounds = airframe.rotor_thrust_max, airframe.joint_torque_max
    # What is within limits is finite as well: no comparison with NaN is true.
    thrusts, torques = command
    # A vehicle has fewer rotors and joints than there are bounds.
    allowed = all(0.0 <= f <= most for f, most in zip(thrusts, top, strict=False))
    if allowed and all(-most <= t <= most for t, most in zip(torques, bounds, strict=False)):
        return command, False
    if not math.isfinite(sum(thrusts) + sum(torques)):
        return last, True
    return ActuatorCommand(
        tuple([clamp(f, 0.0, most) for f, most in zip(thrusts, top, strict=False)]),
        tuple([clamp_magnitude(t, most) for t, most in zip(torques, bounds, strict=False)]),
    ), False
