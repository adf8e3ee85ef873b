"""The sockets towards the flight software and PX4; imports nothing heavy."""

from __future__ import annotations

from typing import Final

from messages.addresses import parse_listener
from messages.byte_stream import ByteStream
from messages.udp import LinkError, PeerSocket, parse_address

__all__ = ["RESEND_S", "ByteStream", "LinkError", "PeerSocket", "parse_address", "parse_listener"]

RESEND_S: Final = 0.25  # patience of one receive, after which a step is sent again
