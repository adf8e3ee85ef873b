"""Many flights: on the cores of this machine or of others, resumable, with progress.

A flight is flown by one thread of one process, so that as many are out as there are cores. One
that raises, hangs or kills its process is tried again a stated number of times; then its row says
why. Rows do not depend on order, process or machine: workers with other code are refused.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Generic, Self

from studies.campaign.journal import Journal
from studies.campaign.ports import Flight, RowT, Scheduler
from studies.campaign.worker import TIME_LIMIT_S, fly_one

ProgressReport = Callable[[int, int], None]  # flights done, flights in all


def silent(done: int, total: int) -> None:
    """Report nothing."""


def mute(sentence: str) -> None:
    """Say nothing."""


@dataclass
class Campaign(Generic[RowT]):
    """Flies flights, each distinct one once.

    As a context manager it keeps its processes from one run to the next; without, each run starts
    and ends its own.
    """

    workers: int = 1  # processes on this machine; 0: in this one
    journal: Path | None = None  # JSON lines; what is in it is not flown again
    report: ProgressReport = silent
    scheduler: Scheduler | None = None  # in place of processes on this machine
    time_limit_s: float = TIME_LIMIT_S  # that a flight may take on its machine
    tries: int = 3  # of a flight that breaks
    say: Callable[[str], None] = mute  # what goes on with workers
    _lines: Journal | None = field(default=None, init=False)
    _cluster: Any = field(default=None, init=False)  # of studies.campaign.cluster, which loads Dask
    _kept_open: bool = field(default=False, init=False)
    _past_journal: bool = field(default=False, init=False)

    def __enter__(self) -> Self:
        self._kept_open = True
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._kept_open = False
        self.close(at_once=kind is not None)

    def close(self, *, at_once: bool = False) -> None:
        """End the processes that fly; ``at_once`` in the middle of a flight."""
        lines, cluster = self._lines, self._cluster
        self._lines = self._cluster = None
        try:
            if lines is not None:
                lines.close()  # on a full disk it cannot write what it still holds
        finally:
            if cluster is not None:
                cluster.close(at_once=at_once)

    @property
    def flies(self) -> bool:
        """Whether rows come from flights, not from the journal any more."""
        return self._past_journal

    def run(self, flights: Sequence[Flight[RowT]]) -> list[RowT]:
        """Rows in the order of the flights."""
        keys = [flight.key() for flight in flights]
        total, found = len(set(keys)), {}
        self.report(0, total)
        for key, row in self.fly(flights):
            found[key] = row
            self.report(len(found), total)
        return [found[key] for key in keys]

    def fly(self, flights: Sequence[Flight[RowT]]) -> Iterator[tuple[str, RowT]]:
        """Key and row of each distinct flight as they come; those of the journal first."""
        try:
            self._past_journal = False
            if self.journal is not None and self._lines is None:
                self._lines = Journal(self.journal)
            known = set()
            for key, flight in _distinct(flights):
                row = self._from_journal(key, flight)
                if row is not None:
                    known.add(key)
                    yield key, row
            self._past_journal = True
            missing = (pair for pair in _distinct(flights) if pair[0] not in known)
            yield from self._flown(missing)
        except BaseException:
            self.close(at_once=True)
            raise
        finally:
            if not self._kept_open:
                self.close()

    def _from_journal(self, key: str, flight: Flight[RowT]) -> RowT | None:
        line = None if self._lines is None else self._lines.get(key)
        if line is not None:
            with contextlib.suppress(TypeError, KeyError):
                return flight.from_line(line)
        return None

    def _flown(self, flights: Iterator[tuple[str, Flight[RowT]]]) -> Iterator[tuple[str, RowT]]:
        """Rows as they come; each is in the journal before it is given on."""
        for rows in self._here(flights) if self._serial else self._elsewhere(flights):
            if self._lines is not None:
                self._lines.append((key, asdict(row)) for key, row in rows)
            yield from rows

    @property
    def _serial(self) -> bool:
        return self.workers == 0 and self.scheduler is None

    def _here(
        self, flights: Iterable[tuple[str, Flight[RowT]]]
    ) -> Iterator[list[tuple[str, RowT]]]:
        for key, flight in flights:
            for _ in range(self.tries):
                row = fly_one(flight, self.time_limit_s, hard=False)
                if not row.error:
                    break
            yield [(key, row)]

    def _elsewhere(
        self, flights: Iterator[tuple[str, Flight[RowT]]]
    ) -> Iterator[list[tuple[str, RowT]]]:
        first = next(flights, None)
        if first is None:
            return  # no reason to start any process
        from itertools import chain

        from studies.campaign.cluster import Cluster
        from studies.campaign.dispatch import Dispatch

        if self._cluster is None:
            self._cluster = Cluster(self.workers, self.scheduler, self.say)
        yield from Dispatch[RowT](
            self._cluster, chain((first,), flights), self.tries, self.time_limit_s
        ).rows()


def _distinct(flights: Iterable[Flight[RowT]]) -> Iterator[tuple[str, Flight[RowT]]]:
    seen: set[str] = set()
    for flight in flights:
        key = flight.key()
        if key not in seen:
            seen.add(key)
            yield key, flight
