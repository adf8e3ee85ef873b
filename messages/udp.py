"""The UDP socket between simulator and flight software.

Timeouts are set in the kernel (SO_RCVTIMEO): Python's own timeout costs one more system call for
each datagram.
"""

from __future__ import annotations

import select
import socket
import struct
from typing import Final

from messages.addresses import Address, LinkError, parse_address
from messages.busy_poll import BusyPollReceiver

__all__ = ["MAX_DATAGRAM", "Address", "LinkError", "PeerSocket", "parse_address"]

MAX_DATAGRAM: Final = 2048  # bytes; a larger datagram is cut and its last frame then refused

_RECEIVE_BUFFER: Final = 1 << 20  # bytes: rides out a pause of the receiver


class PeerSocket:
    """Talks to one peer: the one it is connected to, or, once bound, the one it decides to serve.

    Once there is a peer the kernel drops whatever comes from elsewhere.
    """

    def __init__(self, patience_s: float) -> None:
        """Open a socket whose :meth:`receive` waits for ``patience_s``."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        seconds = int(patience_s)
        waiting = struct.pack("ll", seconds, round((patience_s - seconds) * 1e6))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, waiting)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
        self._receive = BusyPollReceiver(self._socket, MAX_DATAGRAM)
        self._ready = select.poll()
        self._ready.register(self._socket, select.POLLIN)

    @classmethod
    def connected(cls, peer: Address, patience_s: float) -> PeerSocket:
        """A socket towards ``peer``.

        Raises:
            LinkError: The system refuses the peer's address.
        """
        opened = cls(patience_s)
        try:
            opened.serve(peer)
        except OSError as error:
            opened.close()
            raise LinkError(f"cannot send to udp:{peer[0]}:{peer[1]}: {error.strerror}") from None
        return opened

    @classmethod
    def bound(cls, local: Address, patience_s: float) -> PeerSocket:
        """A socket at a port of this machine; port 0 lets the system choose.

        Raises:
            LinkError: The port is in use or the address is not of this machine.
        """
        opened = cls(patience_s)
        try:
            opened._socket.bind(local)
        except OSError as error:
            opened.close()
            reason = error.strerror or str(error)
            raise LinkError(
                f"cannot listen on udp:{local[0]}:{local[1]}: {reason[0].lower()}{reason[1:]}"
            ) from None
        return opened

    @property
    def address(self) -> Address:
        """Where this socket listens."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def serve(self, peer: Address) -> None:
        """Talk to this peer only from now on."""
        self._socket.connect(peer)

    def receive_from_anyone(self) -> tuple[bytes, Address] | None:
        """Wait for a datagram and its sender; None when the patience is over."""
        try:
            return self._socket.recvfrom(MAX_DATAGRAM)
        except (BlockingIOError, ConnectionRefusedError):
            return None

    def receive(self) -> bytes | None:
        """Wait for a datagram; None when the patience is over or the peer's port is closed."""
        try:
            return self._receive()
        except (BlockingIOError, ConnectionRefusedError):
            return None

    def receive_waiting(self) -> bytes | None:
        """Return a datagram of the peer that is already there, or None."""
        try:
            return self._socket.recv(MAX_DATAGRAM, socket.MSG_DONTWAIT)
        except (BlockingIOError, ConnectionRefusedError):
            return None

    def has_waiting(self) -> bool:
        """Whether a datagram is there: half of what it takes to find none by receiving."""
        return bool(self._ready.poll(0))

    def wait(self, wait_s: float) -> bool:
        """Wait until a datagram is there; False when the time is over."""
        return bool(select.select((self._socket,), (), (), wait_s)[0])

    def send(self, datagram: bytes) -> None:
        """Send one datagram; UDP promises nothing, so neither does this."""
        try:  # a context would cost more than this
            self._socket.send(datagram)
        except OSError:
            return

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()
