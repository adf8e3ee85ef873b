"""What a service says, as a client reads it."""

from __future__ import annotations

from fsw.autopilot.signals import StatusText
from fsw.link.wire.outgoing import Outgoing, ServiceOutput, WireValues
from messages.frames import FrameWriter, split


def message_of(reported: ServiceOutput) -> int:
    """The id of a message."""
    assert not isinstance(reported, StatusText)
    return reported.message_id


def values_of(reported: ServiceOutput) -> WireValues:
    """Every field of a message, whether it was packed already or not."""
    assert isinstance(reported, Outgoing)
    if not isinstance(reported.values, bytes):
        return reported.values
    (frame,) = split(FrameWriter(1, 1).packed_frame(reported.message_id, reported.values))
    return frame.payload_values
