"""Who receives telemetry."""

from __future__ import annotations

from typing import Final

from fsw.link.udp_endpoint import Address

_MAX_LEARNT: Final = 4


class Peers:
    """The configured ground station and the few others that were heard last.

    Bounded, so that a flood of forged sources cannot turn the vehicle into an amplifier.
    """

    def __init__(self, configured: Address) -> None:
        self._configured = configured
        self._learnt: dict[Address, None] = {}  # in order of the last time each was heard
        self.all: tuple[Address, ...] = (configured,)

    def heard(self, peer: Address) -> None:
        """Note a peer that has just sent a valid frame."""
        if peer == self._configured:
            return
        known = peer in self._learnt
        self._learnt.pop(peer, None)
        self._learnt[peer] = None
        if known:
            return
        if len(self._learnt) > _MAX_LEARNT:
            del self._learnt[next(iter(self._learnt))]
        self.all = (self._configured, *self._learnt)
