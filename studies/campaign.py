"""Many flights: a pool of processes, a journal to resume from, progress while it runs.

Each process computes with one thread, so that as many run as there are cores. A flight that
raises is a row. A process that dies takes its pool with it: the flights that were out are then
flown one by one, each in a process of its own, and the one that kills it again is a row as well.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Protocol, Self, TypeVar

from fsw.runtime.process import die_with_parent, pin_numerics_to_one_thread

ProgressReport = Callable[[int, int], None]  # flights done, flights in all


class Row(Protocol):
    """What a flight leaves."""

    @property
    def error(self) -> bool:
        """Whether the flight itself broke, not the vehicle: it is flown again on resuming."""

    def as_line(self) -> Mapping[str, Any]:
        """The row as it is kept in a journal."""


RowT = TypeVar("RowT", bound=Row)
RowT_co = TypeVar("RowT_co", bound=Row, covariant=True)


class Flight(Protocol[RowT_co]):
    """What is flown."""

    def key(self) -> str:
        """Its name: same flight, same name, in any process, while the code is the same."""

    def row(self) -> RowT_co:
        """Fly it here and now; an exception becomes a row with the error."""

    def broken(self, reason: str) -> RowT_co:
        """The row that stands for it if it cannot be flown."""

    def from_line(self, line: Mapping[str, Any]) -> RowT_co:
        """Its row as it was kept; a TypeError or KeyError if another version kept it."""


def silent(done: int, total: int) -> None:
    """Report nothing."""


@dataclass
class Campaign(Generic[RowT]):
    """Flies flights, each distinct one once."""

    workers: int = 1  # 0: in this process
    journal: Path | None = None  # JSON lines; what is in it is not flown again
    report: ProgressReport = silent
    _kept: dict[str, Mapping[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.journal is not None and self.journal.exists():
            self._kept.update(_lines(self.journal))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes that fly."""

    def run(self, flights: Sequence[Flight[RowT]]) -> list[RowT]:
        """Rows in the order of the flights."""
        keys = [flight.key() for flight in flights]
        distinct = dict(zip(keys, flights, strict=True))
        known = self._known(distinct)
        self.report(len(known), len(distinct))
        missing = {key: flight for key, flight in distinct.items() if key not in known}
        for key, row in self._flown(missing):
            known[key] = row
            self._keep(key, row)
            self.report(len(known), len(distinct))
        return [known[key] for key in keys]

    def _known(self, flights: Mapping[str, Flight[RowT]]) -> dict[str, RowT]:
        known = {}
        for key in flights.keys() & self._kept.keys():
            with contextlib.suppress(TypeError, KeyError):
                known[key] = flights[key].from_line(self._kept[key])
        return known

    def _flown(self, flights: Mapping[str, Flight[RowT]]) -> Iterator[tuple[str, RowT]]:
        if self.workers == 0:
            for key, flight in flights.items():
                yield key, flight.row()
            return
        waiting = deque(flights.items())
        while waiting:
            suspects = yield from self._pooled(waiting)
            for key, flight in suspects:
                yield key, _alone(flight)

    def _pooled(
        self, waiting: deque[tuple[str, Flight[RowT]]]
    ) -> Generator[tuple[str, RowT], None, tuple[tuple[str, Flight[RowT]], ...]]:
        """Fly what waits; returns early, with the flights that were out, if a process dies."""
        pool = pool_of(self.workers)
        out: dict[Future[RowT], tuple[str, Flight[RowT]]] = {}
        try:
            while waiting or out:
                while waiting and len(out) < self.workers:
                    out[pool.submit(waiting[0][1].row)] = waiting[0]
                    waiting.popleft()
                for future in wait(out, return_when=FIRST_COMPLETED).done:
                    row = future.result()
                    key, _ = out.pop(future)
                    yield key, row
        except BrokenProcessPool:
            return tuple(out.values())
        except BaseException:
            for process in multiprocessing.active_children():
                process.kill()  # or leaving would wait for flights that are no longer wanted
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
        return ()

    def _keep(self, key: str, row: RowT) -> None:
        if self.journal is None or row.error:
            return
        self._kept[key] = row.as_line()
        self.journal.parent.mkdir(parents=True, exist_ok=True)
        with self.journal.open("a", encoding="utf-8") as lines:
            # A line of its own even after one that an interrupt cut short.
            lines.write("\n" + json.dumps({"key": key, **self._kept[key]}) + "\n")


def pool_of(workers: int) -> ProcessPoolExecutor:
    """Processes that fly; SIGINT is for the one that started them, and they end with it."""
    pin_numerics_to_one_thread()  # inherited by the processes, before they load their libraries
    spawn = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, spawn, initializer=_begin, initargs=(os.getpid(),))


def _begin(parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the campaign ends its processes
    die_with_parent(parent)


def _alone(flight: Flight[RowT]) -> RowT:
    """Fly in a process that nothing else depends on."""
    with pool_of(1) as pool:
        try:
            return pool.submit(flight.row).result()
        except BrokenProcessPool:
            return flight.broken("the process that flew it died")


def _lines(journal: Path) -> dict[str, dict[str, Any]]:
    """What a journal keeps, by key; lines cut short by an interrupt are dropped."""
    kept = {}
    for line in journal.read_text(encoding="utf-8").splitlines():
        with contextlib.suppress(json.JSONDecodeError, TypeError, KeyError):
            content = json.loads(line)
            kept[content.pop("key")] = content
    return kept
