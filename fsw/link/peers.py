"""Receivers of telemetry."""

from __future__ import annotations

from typing import Final

from fsw.link.udp_endpoint import Address

EXPIRY_US: Final = 30_000_000  # of silence: ten times what clients call a lost link
_QUIET_US: Final = 2_000_000  # of silence: twice the period of heartbeats
_MAX_LEARNT: Final = 4


class Peers:
    """The configured peer and the few others that came first, and the newest.

    Bounded, so that a flood of forged sources cannot turn the vehicle into an amplifier, and who
    speaks keeps its place: where there is none left, a newcomer has that of the one that has been
    silent longest, or where all speak that of the newest. Silent peers are removed. Times are
    wall time [us], because peers live in it.
    """

    def __init__(self, configured: Address) -> None:
        self.all: tuple[Address, ...] = (configured,)
        self.version_1: frozenset[Address] = frozenset()  # of these, those whose last frame was so
        self._configured = configured
        self._heard_us: dict[Address, int] = {}  # in the order in which they came

    @property
    def heard_of(self) -> frozenset[Address]:
        """Those that speak to us."""
        return frozenset(self._heard_us)

    @property
    def any_heard(self) -> bool:
        """Whether anybody speaks to us."""
        return bool(self._heard_us)

    def heard(self, peer: Address, now_us: int, *, version_1: bool = False) -> None:
        """Note a peer that has just sent a valid frame, of MAVLink 1 or 2."""
        if version_1 != (peer in self.version_1):
            self.version_1 ^= {peer}
        known = peer in self._heard_us
        self._heard_us[peer] = now_us
        if known:
            return
        learnt = [other for other in self._heard_us if other != self._configured]
        if len(learnt) > _MAX_LEARNT:
            quiet = min(learnt[:-1], key=self._heard_us.__getitem__)
            is_silent = now_us - self._heard_us[quiet] > _QUIET_US
            del self._heard_us[quiet if is_silent else learnt[-2]]
        self._list()

    def expire(self, now_us: int) -> None:
        """Remove peers that have been silent for too long; call it once a second."""
        silent = [peer for peer, at in self._heard_us.items() if now_us - at > EXPIRY_US]
        for peer in silent:
            del self._heard_us[peer]
        if silent:
            self._list()

    def _list(self) -> None:
        learnt = (peer for peer in self._heard_us if peer != self._configured)
        self.all = (self._configured, *learnt)
        self.version_1 &= set(self.all)
