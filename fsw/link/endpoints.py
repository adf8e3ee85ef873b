"""The end of a link to the ground, of whatever its address says.

That of the link to the simulator is ``messages.udp.PeerSocket``.
"""

from __future__ import annotations

import select
import socket
import struct
import sys
from typing import Final

from fsw.autopilot.ports import Clock
from messages.addresses import Address, LinkAddress, StreamAddress, address_text
from messages.addresses import LinkError as LinkError
from messages.addresses import parse_address as parse_address
from messages.byte_stream import ByteStream
from messages.frames import Frame, Losses, cut
from messages.stream_reader import PAUSE_US, StreamReader
from messages.udp import MAX_DATAGRAM

_SO_MEMINFO: Final = 55  # Linux; the socket module has no name for it
_MEMINFO: Final = struct.Struct("9I")  # the last is sk_drops
# Of what the ground sends: what a flood leaves waiting in front of a command delays that command.
_QUEUE: Final = 1 << 18
# Read at a time: what a line of 921,600 baud brings in 5 ms, and a fraction of a tick's work.
_READ: Final = 512


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
        if sys.platform != "linux" or self._socket.fileno() < 0:
            return self._dropped
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


class StreamEndpoint:
    """A serial line or a TCP connection: an ``OpenEndpoint`` with one peer, without datagrams."""

    port: Final = None  # of UDP
    dropped: Final = None  # the kernel does not count what it drops of a stream

    def __init__(self, address: StreamAddress, clock: Clock) -> None:
        """Begin to look for the peer, or to listen, else LinkError; the clock is wall time."""
        self.bytes_per_s = address.bytes_per_s
        self._name = address_text(address)
        self._clock = clock
        self._stream = ByteStream(address, clock)
        self._reader = StreamReader()
        self._peer = address.peer
        self._last_read_us = 0
        self._connections = 0  # that were seen
        self._told: tuple[bool, int] | None = None  # whether, and how often, it was connected
        self._connected = False  # once the stream is closed
        self._losses = Losses()  # of earlier connections, not counted yet

    def fileno(self) -> int:
        """The handle, to wait for."""
        return self._stream.fileno()

    def receive_waiting(self) -> tuple[bytes, Address] | None:
        """Some bytes that have come, or none of them because a pause is over; else None."""
        data = self._stream.read(_READ)
        if self._stream.connections != self._connections:
            self._connections = self._stream.connections
            self._reader.forget(self._losses)
        if data:
            self._last_read_us = self._clock()
        elif not (self._reader.waits and self._clock() - self._last_read_us >= PAUSE_US):
            return None
        return data, self._peer

    def cut(self, data: bytes, losses: Losses) -> list[tuple[Frame, bytes]]:
        """The frames that are whole with this data; see :class:`StreamReader`."""
        losses.bytes += self._losses.bytes
        self._losses.bytes = 0
        return self._reader.cut(data, losses)

    def send(self, datagram: bytes, peer: Address) -> None:
        """Send it to whoever there is."""
        self._stream.send(datagram)

    def news(self) -> str | None:
        """In a sentence that the connection has come or gone since the last call; None: neither."""
        stream = self._stream
        state = stream.connected, stream.connections
        if state == self._told:
            return None
        self._told = state
        if stream.connected:
            return f"{self._name} connected" + (" again" if stream.connections > 1 else "")
        if not stream.problem:
            return f"{self._name} waits for a client"
        return f"{self._name} {'lost' if stream.connections else 'not there'}: {stream.problem}"

    def as_json(self) -> dict[str, object]:
        """Counts since start, and whether there was a connection at the end."""
        stream = self._stream
        return {
            "address": self._name,
            "connected": stream.connected or self._connected,
            "connections": stream.connections,
            "datagrams_unsent": stream.dropped,
        }

    def close(self) -> None:
        """Give everything back; safe to call twice."""
        self._connected = self._connected or self._stream.connected
        self._stream.close()


Endpoint = OpenEndpoint | StreamEndpoint


def open_endpoint(
    address: LinkAddress, clock: Clock, local_port: int = 0, *, remote: bool = False
) -> tuple[Endpoint, Address]:
    """Open the end towards an address, and who is spoken to first there; the clock is wall time.

    Of UDP alone are the preferred port and whether other machines are heard, ``remote``: a stream
    has one peer, who is chosen by its address.

    Raises:
        LinkError: A listening end cannot listen.
    """
    if isinstance(address, tuple):
        return OpenEndpoint(address, local_port, remote=remote), address
    return StreamEndpoint(address, clock), address.peer
