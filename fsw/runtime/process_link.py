"""What two processes of the flight software say to each other: whole values, never waiting to send.

A pair of connected local sockets that keep message boundaries: a value arrives whole or not at
all, whenever either side is killed, and a side that is gone is noticed at once.
"""

from __future__ import annotations

import pickle
import socket
from typing import Any, Final

_MOST: Final = 1 << 17  # bytes of one value; a request has about 2 kB


class PeerGone(Exception):
    """The other process has ended."""


class ProcessLink:
    """One end."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end

    def fileno(self) -> int:
        """Its file descriptor."""
        return self._socket.fileno()

    def send(self, value: object) -> bool:
        """Hand a value over; False where the other side has stopped reading.

        Raises:
            PeerGone: There is no other side.
        """
        try:
            self._socket.send(pickle.dumps(value, pickle.HIGHEST_PROTOCOL), socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError:
            raise PeerGone from None
        return True

    def receive(self) -> Any:
        """Wait for a value.

        Raises:
            PeerGone: There is no other side.
        """
        return self._read(0)

    def receive_waiting(self) -> Any:
        """A value that is already there, or None.

        Raises:
            PeerGone: There is no other side, and nothing it said is left.
        """
        try:
            return self._read(socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None

    def close(self) -> None:
        """Leave; the other side notices."""
        self._socket.close()

    def _read(self, flags: int) -> Any:
        try:
            message = self._socket.recv(_MOST, flags)
        except ConnectionError:
            raise PeerGone from None
        if not message:
            raise PeerGone
        return pickle.loads(message)


def process_link() -> tuple[ProcessLink, ProcessLink]:
    """Both ends of a new link."""
    one, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    return ProcessLink(one), ProcessLink(other)
