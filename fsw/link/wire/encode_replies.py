"""Replies to the simulator and to ground stations; pure, in wire order."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import ActuatorCommand, CommandAck
from fsw.link.wire.outgoing import WireValues

_ARMED: Final = 128  # MAV_MODE_FLAG
_CUSTOM_MODE: Final = 1
_LOCKSTEP: Final = 1  # HIL_ACTUATOR_CONTROLS_FLAGS
_CONTROLS: Final = 16


def command_ack(ack: CommandAck) -> WireValues:
    """COMMAND_ACK: no progress, no detail."""
    return (ack.command, ack.result, 0, 0, ack.target_system, ack.target_component)


def hil_actuator_controls(
    airframe: Airframe, t_us: int, actuators: ActuatorCommand
) -> tuple[float, ...]:
    """HIL_ACTUATOR_CONTROLS up to the last control in use, the answer to a HIL_SENSOR of ``t_us``.

    Rotors come first, then joints, each as a share of its largest value.
    """
    thrust, torque = airframe.shares(actuators)
    return (t_us, _LOCKSTEP, *thrust, *torque)


def end_of_controls(used: int, *, armed: bool, gripper: float = 0.0) -> tuple[float, ...]:
    """The rest of HIL_ACTUATOR_CONTROLS after the ``used`` controls, and the mode.

    The last control is the ``gripper`` [1]: 1 closes, -1 opens.
    """
    unused = (0.0,) * (_CONTROLS - 1 - used)
    return (*unused, gripper, _CUSTOM_MODE | (_ARMED if armed else 0))
