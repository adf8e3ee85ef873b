"""The connection to PX4; imports nothing heavy."""

from __future__ import annotations

from messages.addresses import parse_listener
from messages.byte_stream import ByteStream

__all__ = ["ByteStream", "parse_listener"]
