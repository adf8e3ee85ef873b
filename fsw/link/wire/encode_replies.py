"""Replies to the simulator and to ground stations; pure, in wire order."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.signals import ActuatorCommand, CommandAck, JointVector, RotorVector
from fsw.link.wire.outgoing import WireValues

_ARMED: Final = 128  # MAV_MODE_FLAG
_CUSTOM_MODE: Final = 1
_LOCKSTEP: Final = 1  # HIL_ACTUATOR_CONTROLS_FLAGS
_CONTROLS: Final = 16


def command_ack(ack: CommandAck) -> WireValues:
    """COMMAND_ACK: no progress, no detail."""
    return (ack.command, ack.result, 0, 0, ack.target_system, ack.target_component)


def hil_actuator_controls(
    t_us: int, actuators: ActuatorCommand, thrust_scales: RotorVector, torque_scales: JointVector
) -> tuple[float, ...]:
    """HIL_ACTUATOR_CONTROLS up to the last control in use, the answer to a HIL_SENSOR of ``t_us``.

    Rotors come first, then joints. ``thrust_scales`` (r,) [1/N] and ``torque_scales`` (j,)
    [1/(N m)] are the inverses of the largest values.
    """
    rotors = zip(actuators.rotor_thrust, thrust_scales, strict=True)
    joints = zip(actuators.joint_torque, torque_scales, strict=True)
    return (
        t_us,
        _LOCKSTEP,
        *[thrust * scale for thrust, scale in rotors],
        *[torque * scale for torque, scale in joints],
    )


def end_of_controls(used: int, *, armed: bool) -> tuple[float, ...]:
    """The rest of HIL_ACTUATOR_CONTROLS after the ``used`` controls, and the mode."""
    return (*(0.0,) * (_CONTROLS - used), _CUSTOM_MODE | (_ARMED if armed else 0))
