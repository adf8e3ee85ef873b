"""Replies to the simulator and to ground stations; pure, in wire order."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.signals import ActuatorCommand, CommandAck
from fsw.link.wire.outgoing import WireValues

_ARMED: Final = 128  # MAV_MODE_FLAG
_CUSTOM_MODE: Final = 1
_LOCKSTEP: Final = 1  # HIL_ACTUATOR_CONTROLS_FLAGS
_UNUSED_CONTROLS: Final = 10  # of 16


def command_ack(ack: CommandAck) -> WireValues:
    """COMMAND_ACK: no progress, no detail."""
    return (ack.command, ack.result, 0, 0, ack.target_system, ack.target_component)


def hil_actuator_controls(
    t_us: int, actuators: ActuatorCommand, thrust_scale: float, torque_scale: float
) -> tuple[float, ...]:
    """HIL_ACTUATOR_CONTROLS up to the last control in use, the answer to a HIL_SENSOR of ``t_us``.

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
    )


def end_of_controls(*, armed: bool) -> tuple[float, ...]:
    """The rest of HIL_ACTUATOR_CONTROLS: controls that are not used, and the mode."""
    return (*(0.0,) * _UNUSED_CONTROLS, _CUSTOM_MODE | (_ARMED if armed else 0))
