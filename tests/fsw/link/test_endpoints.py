"""From which addresses a vehicle accepts datagrams."""

from __future__ import annotations

import socket

import pytest

from fsw.link.endpoints import OpenEndpoint


def _other_address_of_this_machine() -> str:
    """An address that is not loopback; connecting a datagram socket sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            pytest.skip("this machine has no address but loopback")
        return str(probe.getsockname()[0])


@pytest.mark.parametrize(("target", "heard"), [("127.0.0.1", False), ("192.0.2.1", True)])
def test_only_who_sends_telemetry_to_a_network_hears_that_network(target: str, heard: bool) -> None:
    outside = _other_address_of_this_machine()
    endpoint = OpenEndpoint((target, 14550))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind((outside, 0))
        stranger.sendto(b"hello", (outside, endpoint.port))
        received = endpoint.receive_waiting()
    endpoint.close()
    assert (received is not None) is heard
