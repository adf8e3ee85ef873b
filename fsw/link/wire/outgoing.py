"""A message on its way out, before it is a frame."""

from __future__ import annotations

from dataclasses import dataclass

from fsw.link.wire.message_ids import AUTOPILOT

WireValues = tuple[float | bytes, ...]
"""Every field of a message in wire order, see ``messages.frames.wire_fields``."""


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A message to send to the peers of the link."""

    message_id: int
    values: WireValues
    component: int = AUTOPILOT  # whose sequence it counts in
