"""The end of a link to the ground, of whatever its address says."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.ports import Clock
from fsw.link.udp_endpoint import OpenEndpoint
from messages.addresses import Address, LinkAddress, StreamAddress, address_text
from messages.byte_stream import ByteStream
from messages.frames import Frame, Losses
from messages.stream_reader import PAUSE_US, StreamReader

# Read at a time: what a line of 921,600 baud brings in 5 ms, and a fraction of a tick's work.
_READ: Final = 512


class StreamEndpoint:
    """A serial line or a TCP connection: an ``OpenEndpoint`` with one peer, without datagrams."""

    port: Final = None  # of UDP
    dropped: Final = None  # the kernel does not count what it drops of a stream

    def __init__(self, address: StreamAddress, clock: Clock) -> None:
        """Begin to look for the peer; the clock is wall time.

        Raises:
            LinkError: It listens, and cannot.
        """
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
