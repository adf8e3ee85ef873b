"""Waiting for what another thread or process does: until it is there, not for a while."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

_PAUSE_S = 0.002


def becomes(condition: Callable[[], object], patience_s: float = 30.0) -> bool:
    """Whether something comes true in time; asked at least once, and once more at the end."""
    until = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() >= until:
            return bool(condition())
        time.sleep(_PAUSE_S)
    return True


def wait_for(condition: Callable[[], T], what: str = "", patience_s: float = 30.0) -> T:
    """The first value of a condition that is true."""
    until = time.monotonic() + patience_s
    while not (value := condition()):
        assert time.monotonic() < until, f"waited {patience_s:g} s in vain: {what or condition}"
        time.sleep(_PAUSE_S)
    return value


class LostTime:
    """The seconds in which this machine did not let us run: what a promise in seconds is not for.

    A thread sleeps a hundredth of a second again and again, and adds up by how much it overslept.
    """

    _NAP_S = 0.01

    def __init__(self) -> None:
        self.seconds = 0.0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> LostTime:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._over.is_set():
            begin = time.monotonic()
            time.sleep(self._NAP_S)
            self.seconds += max(time.monotonic() - begin - 2.0 * self._NAP_S, 0.0)
