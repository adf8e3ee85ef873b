"""Which flight is given out when: a bounded number at once, those that break again."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Generic, TypeVar

if TYPE_CHECKING:
    from studies.campaign import Flight, Row
    from studies.cluster import Came, Cluster

RowT = TypeVar("RowT", bound="Row")

# More tasks than this a second would keep the scheduler busy (python -m benchmarks scheduler);
# faster flights go in batches.
TASKS_A_SECOND: Final = 200.0
_MOST_A_TASK: Final = 100
_AHEAD: Final = 2  # tasks out for each thread: one flies, one waits beside it
_WAIT_S: Final = 0.5


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
        cluster: Cluster,
        flights: Iterator[tuple[str, Flight[RowT]]],
        tries: int,
        limit_s: float,
    ) -> None:
        """Take flights as they are needed; each may take ``limit_s`` of its machine's time [s]."""
        self._cluster, self._flights = cluster, flights
        self._tries, self._limit_s = tries, limit_s
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
                if one.task == self._suspect_out:
                    self._suspect_out = None
                rows += self._settled(waiting, one)
            if rows:
                yield rows

    def _fill(self) -> None:
        """Keep every thread busy, and one task ahead.

        Of flights with which a process died one is out at a time, so that none is taken for the
        cause because of another. Before it is given up it is flown while nothing else is out.
        """
        if self._suspects and self._suspect_out is None:
            last = self._suspects[0].deaths >= self._tries - 1
            if not last or not self._out:
                self._suspect_out = self._give((self._suspects.popleft(),))
            if last:
                return  # let all others come home
        elif self._suspect_out is not None and self._last_try_is_out():
            return
        while len(self._out) < max(_AHEAD * self._cluster.threads, 1):
            batch = self._next()
            if not batch:
                return
            self._give(batch)

    def _last_try_is_out(self) -> bool:
        assert self._suspect_out is not None
        return self._out[self._suspect_out][0].deaths >= self._tries - 1

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
        asked = math.ceil(self._cluster.threads / (TASKS_A_SECOND * flight_s))
        return min(max(asked, 1), _MOST_A_TASK)

    def _give(self, batch: tuple[_Waiting[RowT], ...]) -> int:
        task = self._cluster.submit([one.flight for one in batch], self._limit_s)
        self._out[task] = batch
        return task

    def _settled(self, waiting: tuple[_Waiting[RowT], ...], came: Came) -> list[tuple[str, RowT]]:
        """Rows of a task that came back; what has none yet waits again."""
        if came.broke:
            return self._died(waiting, came.broke)
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

    def _died(self, waiting: tuple[_Waiting[RowT], ...], why: str) -> list[tuple[str, RowT]]:
        rows = []
        for one in waiting:
            last = one.deaths + 1 >= self._tries
            if last and len(waiting) == 1:
                rows.append((one.key, one.flight.broken(f"{why}, {self._tries} times")))
            else:
                self._suspects.append(one if last else replace(one, deaths=one.deaths + 1))
        return rows
