"""The socket of a link to the ground; that to the simulator is ``messages.udp.PeerSocket``."""

from __future__ import annotations

import select
import socket
import struct
import sys
from typing import Final

from messages.frames import cut
from messages.udp import MAX_DATAGRAM, Address, LinkError, parse_address

__all__ = ["MAX_DATAGRAM", "Address", "LinkError", "OpenEndpoint", "is_loopback", "parse_address"]

_SO_MEMINFO: Final = 55  # Linux; the socket module has no name for it
_MEMINFO: Final = struct.Struct("9I")  # the last is sk_drops
# Of what the ground sends: what a flood leaves waiting in front of a command delays that command.
_QUEUE: Final = 1 << 18


def is_loopback(address: Address) -> bool:
    """Whether an address is one of this machine alone."""
    return address[0].startswith("127.")


class OpenEndpoint:
    """A socket that talks to anyone and never waits; ``StreamEndpoint`` has what it has."""

    bytes_per_s: Final = None  # not known of a network
    cut = staticmethod(cut)  # no state between datagrams

    def __init__(self, target: Address, local_port: int = 0, *, remote: bool = False) -> None:
        """Open the socket towards the peer that is spoken to first.

        Where that is this machine, only this machine is heard, unless ``remote``: a vehicle must
        not take commands from a network by accident. If the preferred port is taken, the system
        chooses one, so that any number of vehicles share a machine.
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
        self._ready = select.poll()
        self._ready.register(self._socket, select.POLLIN)
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
        if not self._ready.poll(0):  # half of what it takes to find none by receiving
            return None
        try:
            return self._socket.recvfrom(MAX_DATAGRAM)
        except OSError:
            return None

    def send(self, datagram: bytes, peer: Address) -> None:
        """Send one datagram; a peer that cannot be reached is no reason to stop flying."""
        try:  # a context would cost more than this
            self._socket.sendto(datagram, peer)
        except OSError:
            return

    def news(self) -> str | None:
        """Nothing: a socket does not know whether anybody is there."""
        return None

    def as_json(self) -> dict[str, object]:
        """Nothing of its own."""
        return {}

    def close(self) -> None:
        """Give the port back; safe to call twice."""
        self._dropped = self.dropped
        self._socket.close()
