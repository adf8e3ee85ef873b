"""What a link serves beside telemetry and commands: parameters, missions, files, time.

A service is asked by frames and answers with messages; sockets, sequence numbers, signatures and
peers are the link's. There is one instance a link; what it serves may be shared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from fsw.link.message_ids import AUTOPILOT
from messages.frames import Frame

WireValues = tuple[float | bytes, ...]
"""Every field of a message in wire order, see ``messages.frames.wire_fields``."""


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A message to send to the peers of the link."""

    message_id: int
    values: WireValues
    component: int = AUTOPILOT  # whose sequence it counts in


class LinkService(Protocol):
    """One protocol on one link. Checks itself whether a frame is addressed to this vehicle."""

    message_ids: frozenset[int]  # what it wants to hear

    def receive(self, frame: Frame, t_us: int) -> Sequence[Outgoing]:
        """Answer a valid frame at once; never raises.

        Args:
            frame: Its values are of the right type and number, not of any sense.
            t_us: Sensor time [us].
        """
        ...

    def poll(self, t_us: int) -> Sequence[Outgoing]:
        """Go on with an answer that is paced; called every tick, so idle must cost nothing.

        Args:
            t_us: Sensor time [us].
        """
        ...
