"""Which flight is given out when: a bounded number at once, those that break again."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Generic, Protocol

from studies.campaign.ports import Flight, RowT

# A task costs the scheduler one or two milliseconds (python -m benchmarks scheduler): flights that
# would be more go in batches.
TASKS_A_SECOND: Final = 100.0
_MAX_A_TASK: Final = 100
AHEAD: Final = 2  # tasks out for each thread: one flies, one waits beside it
_WAIT_S: Final = 0.5


@dataclass(frozen=True, slots=True)
class Came:
    """What became of a task: rows, or why there are none; neither: it was lost."""

    task: int
    rows: tuple[Any, ...] = ()
    took_s: float = 0.0  # all of them together, on their machine
    broke: str = ""  # the process died, or could not read the task


class Workers(Protocol):
    """Where flights are flown: ``studies.campaign.cluster.Cluster``."""

    @property
    def threads(self) -> int:
        """Flights that can be flown at once."""

    def submit(self, batches: Sequence[Sequence[Any]], limit_s: float) -> list[int]:
        """Give each batch of flights to a worker as a task; the numbers of the tasks."""

    def came(self, wait_s: float) -> list[Came]:
        """What came since, after at most ``wait_s``."""


@dataclass(frozen=True, slots=True)
class _Waiting(Generic[RowT]):
    key: str
    flight: Flight[RowT]
    errors: int = 0  # times its row was one of an error
    deaths: int = 0  # times a process died with it


class Dispatch(Generic[RowT]):
    """One run of flights on a cluster."""

    def __init__(
        self,
        cluster: Workers,
        flights: Iterator[tuple[str, Flight[RowT]]],
        tries: int,
        limit_s: float,
        tasks_a_second: float = TASKS_A_SECOND,
        ahead: int = AHEAD,
    ) -> None:
        """Take flights as they are needed; each may take ``limit_s`` of its machine's time [s].

        Where there would be more than ``tasks_a_second`` [1/s], flights go in batches; ``ahead``
        tasks are out for each thread.
        """
        self._cluster, self._flights = cluster, flights
        self._tries, self._limit_s, self._rate = tries, limit_s, tasks_a_second
        self._ahead = ahead
        self._again: deque[_Waiting[RowT]] = deque()  # lost without having broken
        self._suspects: deque[_Waiting[RowT]] = deque()  # a process died with them
        self._out: dict[int, tuple[_Waiting[RowT], ...]] = {}
        self._suspect_out: int | None = None
        self._flown, self._took_s = 0, 0.0

    def rows(self) -> Iterator[list[tuple[str, RowT]]]:
        """Rows as they come, each once."""
        while True:
            self._fill()
            if not self._out and not self._suspects:
                return
            rows: list[tuple[str, RowT]] = []
            for one in self._cluster.came(_WAIT_S):
                waiting = self._out.pop(one.task, ())
                alone = one.task == self._suspect_out and self._is_last(waiting[0])
                if one.task == self._suspect_out:
                    self._suspect_out = None
                rows += self._settled(waiting, one, alone)
            if rows:
                yield rows

    def _fill(self) -> None:
        """Keep every thread busy, and one task ahead.

        Of flights with which a process died one is out at a time, so that none is taken for the
        cause because of another. Before it is given up it is flown while nothing else is out.
        """
        if self._suspects and self._suspect_out is None:
            last = self._is_last(self._suspects[0])
            if not last or not self._out:
                (self._suspect_out,) = self._give([(self._suspects.popleft(),)])
            if last:
                return  # let all others come home
        elif self._suspect_out is not None and self._is_last(self._out[self._suspect_out][0]):
            return
        room = max(self._ahead * self._cluster.threads, 1) - len(self._out)
        batches: list[tuple[_Waiting[RowT], ...]] = []
        while len(batches) < room and (batch := self._next()):
            batches.append(batch)
        if batches:
            self._give(batches)

    def _is_last(self, suspect: _Waiting[RowT]) -> bool:
        """Whether it is tried for the last time, and hence alone."""
        return suspect.deaths >= self._tries - 1

    def _next(self) -> tuple[_Waiting[RowT], ...]:
        found: list[_Waiting[RowT]] = []
        while len(found) < self._batch():
            if self._again:
                found.append(self._again.popleft())
                continue
            fresh = next(self._flights, None)
            if fresh is None:
                break
            found.append(_Waiting(*fresh))
        return tuple(found)

    def _batch(self) -> int:
        """Flights a task."""
        if self._flown == 0:
            return 1
        flight_s = max(self._took_s / self._flown, 1e-6)
        asked = math.ceil(self._cluster.threads / (self._rate * flight_s))
        return min(max(asked, 1), _MAX_A_TASK)

    def _give(self, batches: list[tuple[_Waiting[RowT], ...]]) -> list[int]:
        flights = [[one.flight for one in batch] for batch in batches]
        tasks = self._cluster.submit(flights, self._limit_s)
        self._out.update(zip(tasks, batches, strict=True))
        return tasks

    def _settled(
        self, waiting: tuple[_Waiting[RowT], ...], came: Came, alone: bool
    ) -> list[tuple[str, RowT]]:
        """Rows of a task that came back; what has none yet waits again."""
        if came.broke and alone:
            (one,) = waiting
            return [(one.key, one.flight.broken(f"{came.broke}; tried {self._tries} times"))]
        if came.broke:
            most = self._tries - 1
            self._suspects += [replace(one, deaths=min(one.deaths + 1, most)) for one in waiting]
            return []
        if not came.rows:
            for one in waiting:
                (self._suspects if one.deaths else self._again).append(one)
            return []
        self._flown += len(waiting)
        self._took_s += came.took_s
        rows = []
        for one, row in zip(waiting, came.rows, strict=True):
            if row.error and one.errors + 1 < self._tries:
                self._again.append(replace(one, errors=one.errors + 1))
            else:
                rows.append((one.key, row))
        return rows
