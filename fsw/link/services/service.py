"""What a link serves beside telemetry and commands: parameters, missions, files, time.

A service is asked by frames and answers with messages and sentences; sockets, sequence numbers,
signatures and peers are the link's. There is one instance a link; what it serves may be shared.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from fsw.link.wire.outgoing import ServiceOutput
from messages.frames import Frame


class LinkService(Protocol):
    """One protocol on one link. Checks itself whether a frame is addressed to this vehicle."""

    message_ids: frozenset[int]  # what it wants to hear

    def handle(self, frame: Frame, t_us: int) -> Sequence[ServiceOutput]:
        """Answer a valid frame at once; never raises.

        Args:
            frame: Its values are of the right type and number, not of any sense.
            t_us: Sensor time [us].
        """
        ...

    def poll(self, t_us: int) -> Sequence[ServiceOutput]:
        """Continue a paced answer; called every tick, so it must be cheap when idle.

        Args:
            t_us: Sensor time [us].
        """
        ...


@runtime_checkable
class BulkService(LinkService, Protocol):
    """A service with much to send to clients that set the pace themselves, piece by piece."""

    def bulk(self, t_us: int) -> Sequence[ServiceOutput]:
        """The next datagram; nothing without a transfer.

        Called repeatedly in the spare time of a tick, so that it delays none.

        Args:
            t_us: Sensor time [us].
        """
        ...
