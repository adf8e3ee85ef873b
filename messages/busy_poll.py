"""Busy polling of a socket, for as long as it pays.

In lockstep the other process answers within tens of microseconds, less than the system takes to
wake a processor. Where each process has a processor of its own, polling keeps it awake. Where they
share one, polling only delays the answer: after a few timeouts it is switched off for a while.
"""

from __future__ import annotations

import socket
import time
from typing import Final

_LOOK_S: Final = 1.5e-3  # no longer than this before sleeping: a planning step takes 1 ms
_PRICE: Final = 10  # answers in time that make up for a vain look
_MOST: Final = 100
_REST: Final = 5000  # receives without a look, where looking did not pay


class BusyPollReceiver:
    """Receives from one socket, whose timeout is set in the kernel."""

    def __init__(self, source: socket.socket, size: int) -> None:
        """Start out eager; no datagram has more than ``size`` bytes."""
        self._receive = source.recv
        self._size = size
        self._credit = _MOST  # a first plan is slow, and more than one thing at a start
        self._rest = 0

    def __call__(self) -> bytes:
        """Wait for a datagram.

        Raises:
            OSError: as of ``socket.recv``; BlockingIOError when the socket's patience is over.
        """
        if self._rest:
            self._rest -= 1
            return self._receive(self._size)
        until_s = 0.0  # one that is there already needs no look at the clock
        while True:
            try:
                datagram = self._receive(self._size, socket.MSG_DONTWAIT)
            except BlockingIOError:
                now_s = time.perf_counter()
                until_s = until_s or now_s + _LOOK_S
                if now_s < until_s:
                    continue
                break
            if self._credit < _MOST:
                self._credit += 1
            return datagram
        self._credit -= _PRICE
        if self._credit <= 0:
            self._credit, self._rest = 2 * _PRICE, _REST
        return self._receive(self._size)
