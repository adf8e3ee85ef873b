"""The only socket of the simulator.

It hears anyone until it is told whom to serve; from then on the kernel drops whatever comes from
elsewhere. The timeout is set in the kernel (SO_RCVTIMEO): Python's own costs one more system call
for each datagram.
"""

from __future__ import annotations

import contextlib
import re
import socket
import struct
from typing import Final

from messages.busy_poll import BusyPollReceiver

Address = tuple[str, int]

RESEND_S: Final = 0.25  # patience of one receive, after which a step is sent again
MAX_DATAGRAM: Final = 2048  # bytes; a larger datagram is cut and its last frame then refused

_ADDRESS = re.compile(r"udp:(?P<host>[^:\s]+):(?P<port>\d{1,5})")
_RECEIVE_BUFFER: Final = 1 << 20  # bytes: rides out a pause of the receiver


class LinkError(Exception):
    """A link that cannot be opened, in one sentence for the operator."""


def parse_address(text: str) -> Address:
    """Read ``udp:HOST:PORT``; port 0 lets the system choose.

    Raises:
        LinkError: The text has another form, the port is out of range, or the host is unknown.
    """
    match = _ADDRESS.fullmatch(text)
    if match is None:
        raise LinkError(f"address {text!r} is not of the form udp:HOST:PORT")
    port = int(match["port"])
    if not 0 <= port <= 65535:
        raise LinkError(f"address {text!r}: port {port} is outside 0..65535")
    try:
        return socket.gethostbyname(match["host"]), port
    except OSError:
        raise LinkError(f"address {text!r}: host {match['host']!r} is not known") from None


class UdpEndpoint:
    """A bound socket that serves one peer once it is known."""

    def __init__(self, local: Address, patience_s: float) -> None:
        """Bind.

        Args:
            local: Where to listen.
            patience_s: How long a receive waits [s].

        Raises:
            LinkError: The port is in use or the address is not of this machine.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        seconds = int(patience_s)
        waiting = struct.pack("ll", seconds, round((patience_s - seconds) * 1e6))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, waiting)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
        try:
            self._socket.bind(local)
        except OSError as error:
            self._socket.close()
            reason = error.strerror or str(error)
            raise LinkError(
                f"cannot listen on udp:{local[0]}:{local[1]}: {reason[0].lower()}{reason[1:]}"
            ) from None
        self._receive = BusyPollReceiver(self._socket, MAX_DATAGRAM)

    @property
    def address(self) -> Address:
        """Where this endpoint listens."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def receive_from_anyone(self) -> tuple[bytes, Address] | None:
        """Wait for a datagram and its sender; None when the patience is over."""
        try:
            return self._socket.recvfrom(MAX_DATAGRAM)
        except (BlockingIOError, ConnectionRefusedError):
            return None

    def serve(self, peer: Address) -> None:
        """Talk to this peer only from now on."""
        self._socket.connect(peer)

    def receive(self) -> bytes | None:
        """Wait for a datagram of the peer; None when the patience is over or it is gone."""
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

    def send(self, datagram: bytes) -> None:
        """Send one datagram to the peer; one that is gone shows as silence."""
        with contextlib.suppress(OSError):
            self._socket.send(datagram)

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()
