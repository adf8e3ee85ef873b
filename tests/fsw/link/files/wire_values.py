"""What a service says, as a client reads it."""

from __future__ import annotations

from fsw.link.wire.outgoing import Outgoing, PackedOutgoing, WireValues
from messages.frames import FrameWriter, split


def values_of(said: Outgoing | PackedOutgoing) -> WireValues:
    """Every field of a message, whether it was packed already or not."""
    if isinstance(said, Outgoing):
        return said.values
    (frame,) = split(FrameWriter(1, 1).packed_frame(said.message_id, said.payload))
    return frame.payload_values
