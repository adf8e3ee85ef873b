"""Threads that do their work when a test says so."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any


class AtOnce(Executor):
    """Does everything at once, or keeps it until ``go``."""

    def __init__(self, *, waits: bool = False) -> None:
        self._waits = waits
        self._kept: list[Callable[[], None]] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()

        def work() -> None:
            try:
                future.set_result(fn(*args, **kwargs))
            except Exception as error:
                future.set_exception(error)

        self._kept.append(work)
        if not self._waits:
            self.go()
        return future

    def go(self) -> None:
        """Do what was kept."""
        kept, self._kept = self._kept, []
        for work in kept:
            work()
