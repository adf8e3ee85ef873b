"""A network between simulator and vehicle that loses, doubles, delays and reorders datagrams."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np

from sitl.faults.keys import LINKS, Fault
from sitl.seeds import stream


class Endpoint(Protocol):
    """One end of the link to the vehicle."""

    def send(self, datagram: bytes) -> None:
        """Send one datagram."""
        ...

    def receive(self) -> bytes | None:
        """Wait for a datagram; None when the patience is over."""
        ...

    def receive_waiting(self) -> bytes | None:
        """A datagram that is already there, or None."""
        ...


class Direction:
    """What becomes of the datagrams of one direction."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._late: deque[tuple[float, bytes]] = deque()
        self._overtaken: list[bytes] = []

    def through(self, datagram: bytes, faults: list[Fault], now_s: float) -> list[bytes]:
        """Datagrams that arrive at ``now_s`` [s], when one is sent: none, it, or others as well.

        What is late comes out of :meth:`due`.
        """
        arrive = [datagram]
        for fault in faults:
            hit = self._random.random() < fault.share
            if fault.kind == "off" or (fault.kind == "intermittent" and hit):
                arrive = []
            elif fault.kind == "duplicated" and hit:
                arrive = [one for one in arrive for _ in range(2)]
            elif fault.kind == "delayed":
                self._late += [(now_s + 1e-3 * fault.delay_ms, one) for one in arrive]
                arrive = []
            elif fault.kind == "reordered":
                if hit and not self._overtaken:
                    self._overtaken, arrive = arrive, []
                else:
                    arrive, self._overtaken = [*arrive, *self._overtaken], []
        return arrive

    def due(self, now_s: float) -> list[bytes]:
        """What was late and arrives at ``now_s``."""
        arrived = []
        while self._late and self._late[0][0] <= now_s:
            arrived.append(self._late.popleft()[1])
        return arrived


class FaultyEndpoint:
    """An endpoint behind such a network; without an active fault it changes nothing."""

    def __init__(
        self,
        endpoint: Endpoint,
        active: Callable[[], tuple[Fault, ...]],
        seed: int,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        """``active`` says what fails now; delays are of the clock's time."""
        self._endpoint = endpoint
        self._active = active
        self._clock = clock
        self._out, self._in = (Direction(stream(seed, "fault", unit)) for unit in LINKS)
        self._arrived: deque[bytes] = deque()

    def send(self, datagram: bytes) -> None:
        """See :class:`Endpoint`."""
        now_s = self._clock()
        late = self._out.due(now_s)
        for one in (*late, *self._out.through(datagram, self._faults("to vehicle"), now_s)):
            self._endpoint.send(one)

    def receive(self) -> bytes | None:
        """See :class:`Endpoint`."""
        return self._take() or self._heard(self._endpoint.receive())

    def receive_waiting(self) -> bytes | None:
        """See :class:`Endpoint`."""
        found = self._take()
        while found is None:
            datagram = self._endpoint.receive_waiting()
            if datagram is None:
                return None
            found = self._heard(datagram)
        return found

    def _heard(self, datagram: bytes | None) -> bytes | None:
        if datagram is not None:
            faults, now_s = self._faults("to simulator"), self._clock()
            self._arrived += self._in.through(datagram, faults, now_s)
        return self._take()

    def _take(self) -> bytes | None:
        self._arrived += self._in.due(self._clock())
        return self._arrived.popleft() if self._arrived else None

    def _faults(self, unit: str) -> list[Fault]:
        return [fault for fault in self._active() if fault.unit == unit]
