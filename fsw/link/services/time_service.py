"""TIMESYNC and PING: what time it is on the vehicle, and how far away that is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from fsw.link.services.service import LinkService
from fsw.link.wire.decode import Numbers
from fsw.link.wire.outgoing import Outgoing
from messages.frames import Frame
from messages.message_ids import PING, TIMESYNC


class TimeService(LinkService):
    """Answers in the vehicle's own time, with which its messages are stamped."""

    message_ids = frozenset({PING, TIMESYNC})

    def handle(self, frame: Frame, t_us: int) -> Sequence[Outgoing]:
        """Answer a request; replies to other systems are ignored."""
        if frame.message_id == TIMESYNC:
            answered_ns, sent_ns = frame.payload_values
            return () if answered_ns else (Outgoing(TIMESYNC, (1000 * t_us, sent_ns)),)
        time_us, sequence, system, component = cast(Numbers, frame.payload_values)
        if system or component:
            return ()  # a ping with a target is an answer
        return (Outgoing(PING, (time_us, sequence, frame.system_id, frame.component_id)),)
