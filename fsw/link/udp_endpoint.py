"""The only sockets of the flight software.

Timeouts are set in the kernel (SO_RCVTIMEO): Python's own timeout costs one more system call for
each datagram.
"""

from __future__ import annotations

import contextlib
import re
import select
import socket
import struct
import sys
from typing import Final

from messages.busy_poll import BusyPollReceiver

Address = tuple[str, int]

MAX_DATAGRAM: Final = 2048  # bytes; a larger datagram is cut and its last frame then refused

_ADDRESS = re.compile(r"udp:(?P<host>[^:\s]+):(?P<port>\d{1,5})")
_RECEIVE_BUFFER: Final = 1 << 20  # bytes: rides out a pause of the receiver
_SO_MEMINFO: Final = 55  # Linux; the socket module has no name for it
_MEMINFO: Final = struct.Struct("9I")  # the last is sk_drops
# Of what the ground sends: what a flood leaves waiting in front of a command delays that command.
_QUEUE: Final = 1 << 18


class LinkError(Exception):
    """A link that cannot be opened, in one sentence for the operator."""


def parse_address(text: str, *, any_port: bool = False) -> Address:
    """Read ``udp:HOST:PORT``.

    Args:
        text: The address as typed.
        any_port: Allow port 0, which lets the system choose.

    Returns:
        The host as an IPv4 address and the port.

    Raises:
        LinkError: The text has another form, the port is out of range, or the host is unknown.
    """
    match = _ADDRESS.fullmatch(text)
    if match is None:
        raise LinkError(f"address {text!r} is not of the form udp:HOST:PORT")
    port = int(match["port"])
    if not (0 if any_port else 1) <= port <= 65535:
        raise LinkError(f"address {text!r}: port {port} is outside 1..65535")
    try:
        return socket.gethostbyname(match["host"]), port
    except OSError:
        raise LinkError(f"address {text!r}: host {match['host']!r} is not known") from None


def is_loopback(address: Address) -> bool:
    """Whether an address is one of this machine alone."""
    return address[0].startswith("127.")


class ConnectedEndpoint:
    """A socket that talks to one peer; the kernel drops whatever comes from elsewhere."""

    def __init__(self, peer: Address, patience_s: float) -> None:
        """Open a socket towards ``peer``.

        Args:
            peer: Where to send and whom to hear.
            patience_s: How long :meth:`receive` waits [s].

        Raises:
            LinkError: The system refuses the peer's address.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        seconds = int(patience_s)
        waiting = struct.pack("ll", seconds, round((patience_s - seconds) * 1e6))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, waiting)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
        try:
            self._socket.connect(peer)
        except OSError as error:
            self._socket.close()
            raise LinkError(f"cannot send to udp:{peer[0]}:{peer[1]}: {error.strerror}") from None
        self._receive = BusyPollReceiver(self._socket, MAX_DATAGRAM)

    def receive(self) -> bytes | None:
        """Wait for a datagram; None when the patience is over or the peer's port is closed."""
        try:
            return self._receive()
        except (BlockingIOError, ConnectionRefusedError):
            return None

    def receive_waiting(self) -> bytes | None:
        """Return a datagram that is already there, or None."""
        try:
            return self._socket.recv(MAX_DATAGRAM, socket.MSG_DONTWAIT)
        except (BlockingIOError, ConnectionRefusedError):
            return None

    def wait(self, seconds: float) -> bool:
        """Wait until a datagram is there; False when the time is over."""
        return bool(select.select((self._socket,), (), (), seconds)[0])

    def send(self, datagram: bytes) -> None:
        """Send one datagram; UDP promises nothing, so neither does this."""
        with contextlib.suppress(OSError):
            self._socket.send(datagram)

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


class OpenEndpoint:
    """A socket that talks to anyone and never waits."""

    def __init__(self, target: Address, local_port: int = 0, *, remote: bool = False) -> None:
        """Open the socket.

        Args:
            target: Peer that is spoken to first. Where that is this machine, only this machine is
                heard: a vehicle must not take commands from a network by accident.
            local_port: Preferred, so that a peer can know it beforehand; if it is taken, the system
                chooses one, so that any number of vehicles share a machine.
            remote: Hear other machines anyway.
        """
        local = "" if remote or not is_loopback(target) else target[0]
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _QUEUE)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        try:
            self._socket.bind((local, local_port))
        except OSError:
            self._socket.bind((local, 0))
        self._socket.setblocking(False)
        self._dropped: int | None = None  # once the socket is closed

    @property
    def dropped(self) -> int | None:
        """Datagrams that found no room in the kernel; None where it does not count them."""
        return self._drops() if self._socket.fileno() >= 0 else self._dropped

    def _drops(self) -> int | None:
        if sys.platform != "linux":
            return None
        try:
            counts = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMINFO.size)
            return int(_MEMINFO.unpack(counts)[-1])
        except (OSError, struct.error):
            return None

    @property
    def port(self) -> int:
        """The local port."""
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        """The handle, to wait for."""
        return self._socket.fileno()

    def receive_waiting(self) -> tuple[bytes, Address] | None:
        """Return a datagram that is already there and its sender, or None."""
        try:
            return self._socket.recvfrom(MAX_DATAGRAM)
        except OSError:
            return None

    def send(self, datagram: bytes, peer: Address) -> None:
        """Send one datagram; a peer that cannot be reached is no reason to stop flying."""
        with contextlib.suppress(OSError):
            self._socket.sendto(datagram, peer)

    def close(self) -> None:
        """Give the port back; safe to call twice."""
        self._dropped = self.dropped
        self._socket.close()
