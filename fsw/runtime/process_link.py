"""Values between two processes of the flight software; sending never waits.

A pair of connected local sockets that keep message boundaries: a value arrives whole or not at
all, even if either side is killed while it writes, and the end of a side is noticed at once.
"""

from __future__ import annotations

import pickle
import socket
from typing import Any, Final

_MAX_BYTES: Final = 1 << 17  # of one value; a request has about 2 kB


class PeerGone(Exception):
    """The other process has ended."""


class ProcessLink:
    """One end."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self.fileno = end.fileno
        self.close = end.close  # the other side notices

    def send(self, value: object) -> None:
        """Send a value; it is dropped if the other side has not read for long.

        Raises:
            PeerGone: The other process has ended.
        """
        try:
            self._socket.send(pickle.dumps(value, pickle.HIGHEST_PROTOCOL), socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError:
            raise PeerGone from None

    def receive(self, *, wait: bool) -> Any:
        """The next value; None if there is none and ``wait`` is False.

        Raises:
            PeerGone: The other process has ended, and nothing that it sent is left.
        """
        try:
            message = self._socket.recv(_MAX_BYTES, 0 if wait else socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None
        except ConnectionError:
            raise PeerGone from None
        if not message:
            raise PeerGone
        return pickle.loads(message)


def process_link() -> tuple[ProcessLink, ProcessLink]:
    """Both ends of a new link."""
    one, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    return ProcessLink(one), ProcessLink(other)
