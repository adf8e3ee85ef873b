"""What the flight loop needs of the link to the vehicle: readings in, actuator commands out.

``sim_link.SimLink`` is the one of the simulator. A vehicle with another wire is a class with these
members, opened in ``fsw.app``; neither the loop nor the autopilot knows which one flies.
"""

from __future__ import annotations

from enum import Enum
from typing import Protocol

from fsw.autopilot.signals import (
    CommandAck,
    CommandRequest,
    SensorFrame,
    StatusText,
    TickOutputs,
)


class Pacing(Enum):
    """What releases a tick: the vehicle's own time, or in lockstep each step of the simulator."""

    REALTIME = 0
    LOCKSTEP = 1


class VehicleLink(Protocol):
    """Sensors in, actuators out; what else comes with them goes into the inbox of the links."""

    pacing: Pacing | None  # None until the first step is there
    shutdown: bool  # the other side has ended the run
    retransmissions: int  # answers that were sent again
    notices: list[StatusText]  # for the operator; the loop empties it
    routed_acks: list[CommandAck]  # to commands that were routed; the loop empties it

    def announce(self) -> None:
        """Tell the other side that the vehicle is there, until it sends readings."""

    def wait_for_step(self) -> SensorFrame | None:
        """Wait for new readings; None when none came within the link's patience, or at the end."""

    def newest(self) -> SensorFrame | None:
        """The newest readings that have come; None when none have since the last call."""

    def wait(self, wait_s: float) -> bool:
        """Wait for at most ``wait_s`` [s]; whether something has come."""

    def send_actuators(self, t_us: int, outputs: TickOutputs) -> None:
        """Send what the tick of ``t_us`` [us] commands."""

    def queue_texts(self, texts: tuple[StatusText, ...]) -> None:
        """Send texts with the next command, where the other side takes any."""

    def queue_ack(self, ack: CommandAck) -> None:
        """Acknowledge a command of the other side."""

    def route(self, request: CommandRequest) -> None:
        """Pass a command on to the other side, which answers by ``routed_acks``."""

    def close(self) -> None:
        """End the connection."""
