"""The socket towards the flight software; imports nothing heavy."""

from __future__ import annotations

from typing import Final

from messages.udp import LinkError, PeerSocket, parse_address

__all__ = ["RESEND_S", "LinkError", "PeerSocket", "parse_address"]

RESEND_S: Final = 0.25  # patience of one receive, after which a step is sent again
