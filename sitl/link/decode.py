"""The vehicle's datagrams as values; pure."""

from __future__ import annotations

from typing import Final, NamedTuple, cast

from messages import message_ids, status_text
from messages.frames import Frame, split
from messages.lockstep_codec import LockstepReader
from messages.message_ids import PATH_PLANNER
from sitl.link.failures import Injection
from sitl.link.pilot_messages import Ack
from sitl.simulation import Controls
from vehicles.description import Vehicle

_ARMED: Final = 128  # MAV_MODE_FLAG in the mode of HIL_ACTUATOR_CONTROLS
_GRIPPER: Final = 15  # of the controls: behind every rotor and joint
_WHOLE: Final = range(256)  # numbers of units, kinds and instances
_CONTROLS_ALONE: Final = LockstepReader((message_ids.HIL_ACTUATOR_CONTROLS, 19))


class VehicleReply(NamedTuple):
    """What the vehicle answered to one step."""

    t_us: int  # the step's time stamp
    controls: Controls
    acks: tuple[Ack, ...] = ()
    texts: tuple[str, ...] = ()
    custom_mode: int | None = None  # of the vehicle's HEARTBEAT, where there is one
    injections: tuple[Injection, ...] = ()  # that a ground station asked the vehicle for

    @property
    def says_more(self) -> bool:
        """Whether there is anything for a pilot beside the controls."""
        return bool(self.acks or self.texts or self.custom_mode is not None)


def read_reply(datagram: bytes, vehicle: Vehicle) -> VehicleReply | None:
    """Read an answer of a ``vehicle``; None without HIL_ACTUATOR_CONTROLS."""
    alone = _CONTROLS_ALONE.read(datagram)
    if alone is not None:
        (values,) = alone
        return VehicleReply(int(values[0]), _controls(values, vehicle))
    frames = split(datagram)
    if not frames or frames[-1].message_id != message_ids.HIL_ACTUATOR_CONTROLS:
        return None
    values = cast("tuple[float, ...]", frames[-1].payload_values)
    controls = _controls(values, vehicle)
    return VehicleReply(
        t_us=int(values[0]),
        controls=controls,
        acks=acknowledgements(frames),
        texts=status_text.joined(frames),
        custom_mode=_custom_mode(frames),
        injections=_injections(frames),
    )


def _controls(values: tuple[float, ...], vehicle: Vehicle) -> Controls:
    """From the wire values of HIL_ACTUATOR_CONTROLS: rotors, then joints."""
    _, _, *shares, mode = values
    rotors = len(vehicle.rotors)
    torques = shares[rotors : rotors + len(vehicle.joints)]
    armed = bool(int(mode) & _ARMED)
    return Controls(tuple(shares[:rotors]), tuple(torques), armed, shares[_GRIPPER])


def acknowledgements(frames: list[Frame]) -> tuple[Ack, ...]:
    """COMMAND_ACKs addressed to the pilot or to everyone."""
    return tuple(
        Ack(cast(int, frame.payload_values[0]), cast(int, frame.payload_values[1]))
        for frame in frames
        if frame.message_id == message_ids.COMMAND_ACK
        and frame.payload_values[5] in (0, PATH_PLANNER)
    )


def _injections(frames: list[Frame]) -> tuple[Injection, ...]:
    """MAV_CMD_INJECT_FAILURE, which the vehicle routes here in the name of who sent it.

    The vehicle has refused what is not whole; from anything else it is passed over.
    """
    found = []
    for frame in frames:
        if frame.message_id == message_ids.COMMAND_LONG:
            *params, command, _, _, again = cast("tuple[float, ...]", frame.payload_values)
            if command == message_ids.CMD_INJECT_FAILURE:
                if not all(value in _WHOLE for value in params[:3]):
                    continue
                unit, kind, instance = (int(value) for value in params[:3])
                sender = frame.system_id, frame.component_id
                found.append(Injection(unit, kind, instance, *sender, int(again)))
    return tuple(found)


def _custom_mode(frames: list[Frame]) -> int | None:
    heartbeats = [frame for frame in frames if frame.message_id == message_ids.HEARTBEAT]
    return cast(int, heartbeats[-1].payload_values[0]) if heartbeats else None
