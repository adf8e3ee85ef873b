"""Who is at the other end of a link: receivers of telemetry, and whose turn it is to be heard.

A flood of datagrams, or of datagrams with many frames, delays what its own sender sends after it
and nobody else: what waits is kept for each peer, and for all who are none together.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator
from typing import Final

from fsw.link.endpoints import Endpoint
from messages.addresses import Address
from messages.frames import Frame, Losses

EXPIRY_US: Final = 30_000_000  # of silence: ten times what clients call a lost link
_QUIET_US: Final = 2_000_000  # of silence: twice the period of heartbeats
_MAX_LEARNT: Final = 4
_MIN_COST: Final = 64  # bytes: an empty datagram costs as much as a small one
_AT_ONCE: Final = 16  # datagrams that are fetched from the kernel between two frames
_WAITING: Final = 512  # datagrams of one sender; what comes then is lost


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
        # Of those that speak, in the order in which they came.
        self.last_received_us: dict[Address, int] = {}

    def heard(self, peer: Address, now_us: int, *, version_1: bool = False) -> None:
        """Note a peer that has just sent a valid frame, of MAVLink 1 or 2."""
        if version_1 != (peer in self.version_1):
            self.version_1 ^= {peer}
        known = peer in self.last_received_us
        self.last_received_us[peer] = now_us
        if known:
            return
        learnt = [other for other in self.last_received_us if other != self._configured]
        if len(learnt) > _MAX_LEARNT:
            quiet = min(learnt[:-1], key=self.last_received_us.__getitem__)
            is_silent = now_us - self.last_received_us[quiet] > _QUIET_US
            del self.last_received_us[quiet if is_silent else learnt[-2]]
        self._list()

    def expire(self, now_us: int) -> None:
        """Remove peers that have been silent for too long; call it once a second."""
        silent = [peer for peer, at in self.last_received_us.items() if now_us - at > EXPIRY_US]
        for peer in silent:
            del self.last_received_us[peer]
        if silent:
            self._list()

    def _list(self) -> None:
        learnt = (peer for peer in self.last_received_us if peer != self._configured)
        self.all = (self._configured, *learnt)
        self.version_1 &= set(self.all)


class Arrivals:
    """Fetches the datagrams of one endpoint and hands out their frames."""

    def __init__(self, endpoint: Endpoint, losses: Losses) -> None:
        """What is dropped within datagrams is added to ``losses``."""
        self.read = 0  # datagrams
        self.dropped = 0  # datagrams for which there was no room here
        self.sender: Address = ("", 0)  # of the datagram that was begun last
        self._endpoint = endpoint
        self._at_once = 1 if endpoint.port is None else _AT_ONCE  # a stream has one sender
        self._losses = losses
        self._waiting: dict[Address | None, deque[tuple[bytes, Address]]] = {}  # None: of no peer
        self._frames: Iterator[tuple[Frame, bytes]] | None = None  # the rest of a datagram

    @property
    def waits(self) -> bool:
        """Whether something has been fetched and not been taken."""
        return self._frames is not None or bool(self._waiting)

    def fetch(self, peers: Collection[Address]) -> None:
        """Fetch datagrams that are there, for each of the ``peers`` a number of its own."""
        for _ in range(self._at_once):
            received = self._endpoint.receive_waiting()
            if received is None:
                return
            self.read += 1
            sender = received[1] if received[1] in peers else None
            waiting = self._waiting.setdefault(sender, deque())
            if len(waiting) < _WAITING:
                waiting.append(received)
            else:
                self.dropped += 1

    def begin(self) -> int | None:
        """Begin the next datagram, unless one is begun: its cost [bytes]; None: there is none."""
        if self._frames is not None:
            return 0
        if not self._waiting:
            return None
        turn = next(iter(self._waiting))
        waiting = self._waiting.pop(turn)
        datagram, self.sender = waiting.popleft()
        if waiting:
            self._waiting[turn] = waiting  # behind the others
        self._frames = iter(self._endpoint.cut(datagram, self._losses))
        return max(len(datagram), _MIN_COST)

    def take(self) -> tuple[Frame, bytes] | None:
        """The next frame of the datagram that is begun, with its bytes; None: it is at its end."""
        found = None if self._frames is None else next(self._frames, None)
        if found is None:
            self._frames = None
        return found
