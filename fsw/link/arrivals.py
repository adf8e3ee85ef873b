"""What has come over a link and has not been taken yet: each sender has its turn.

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

_MIN_COST: Final = 64  # bytes: an empty datagram costs as much as a small one
_AT_ONCE: Final = 16  # datagrams that are fetched from the kernel between two frames
_WAITING: Final = 512  # datagrams of one sender; what comes then is lost


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
