"""What a service says, as a client reads it."""

from __future__ import annotations

from fsw.link.wire.outgoing import Outgoing, PackedOutgoing, ServiceOutput, WireValues
from fsw.signals import StatusText
from messages.frames import FrameWriter, split


def message_of(said: ServiceOutput) -> int:
    """The id of a message."""
    assert not isinstance(said, StatusText)
    return said.message_id


def values_of(said: ServiceOutput) -> WireValues:
    """Every field of a message, whether it was packed already or not."""
    if isinstance(said, Outgoing):
        return said.values
    assert isinstance(said, PackedOutgoing)
    (frame,) = split(FrameWriter(1, 1).packed_frame(said.message_id, said.payload))
    return frame.payload_values
