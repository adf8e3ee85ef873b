"""Outgoing messages, before framing."""

from __future__ import annotations

from dataclasses import dataclass

from fsw.autopilot.signals import StatusText
from messages.message_ids import AUTOPILOT

WireValues = tuple[float | bytes, ...]
"""Every field of a message in wire order, see ``messages.frames.wire_fields``."""


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A message to send to the peers of the link."""

    message_id: int
    values: WireValues
    component: int = AUTOPILOT  # whose sequence it counts in


@dataclass(frozen=True, slots=True)
class PackedOutgoing:
    """The same with its payload packed already: the bytes of a file, of which there are many."""

    message_id: int
    payload: bytes  # all of it
    component: int = AUTOPILOT


ServiceOutput = Outgoing | PackedOutgoing | StatusText
"""What a service sends: messages, and texts for the operator."""
