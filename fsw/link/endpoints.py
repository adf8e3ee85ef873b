"""The end of a link to the ground, of whatever its address says."""

from __future__ import annotations

from fsw.autopilot.ports import Clock
from fsw.link.stream_endpoint import StreamEndpoint
from fsw.link.udp_endpoint import OpenEndpoint
from messages.addresses import Address, LinkAddress

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
