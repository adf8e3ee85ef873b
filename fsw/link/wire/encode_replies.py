"""Replies to the simulator and to ground stations; pure, in wire order."""

from __future__ import annotations

from typing import Final

from fsw.link.wire.outgoing import WireValues
from fsw.signals import ActuatorCommand, CommandAck

_ARMED: Final = 128  # MAV_MODE_FLAG
_CUSTOM_MODE: Final = 1
_LOCKSTEP: Final = 1  # HIL_ACTUATOR_CONTROLS_FLAGS


def command_ack(ack: CommandAck) -> WireValues:
    """COMMAND_ACK: no progress, no detail."""
    return (ack.command, ack.result, 0, 0, ack.target_system, ack.target_component)


def hil_actuator_controls(
    t_us: int, actuators: ActuatorCommand, armed: bool, thrust_scale: float, torque_scale: float
) -> WireValues:
    """HIL_ACTUATOR_CONTROLS: the answer to the HIL_SENSOR of ``t_us``.

    ``thrust_scale`` [1/N] and ``torque_scale`` [1/(N m)] are the inverses of the largest values.
    """
    f1, f2, f3, f4 = actuators.rotor_thrust
    tau1, tau2 = actuators.joint_torque
    return (
        t_us,
        _LOCKSTEP,
        f1 * thrust_scale,
        f2 * thrust_scale,
        f3 * thrust_scale,
        f4 * thrust_scale,
        tau1 * torque_scale,
        tau2 * torque_scale,
        *(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        _CUSTOM_MODE | (_ARMED if armed else 0),
    )
