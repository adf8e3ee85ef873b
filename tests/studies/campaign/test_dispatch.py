"""Which flight is given out when, on a cluster of the test's own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from studies.campaign.campaign import _distinct
from studies.campaign.dispatch import Came, Dispatch
from tests.studies.campaign.stub_flights import StubFlight, StubRow


class OwnCluster:
    """Flies a task when it is asked what came; a flight that kills takes what waits with it."""

    def __init__(self, threads: int = 2, took_s: float = 1.0) -> None:
        self.threads, self.took_s = threads, took_s
        self.out: dict[int, tuple[StubFlight, ...]] = {}
        self.given: list[tuple[str, ...]] = []
        self.max_out = 0
        self.loses = 0  # tasks that are lost once

    def submit(self, batches: Sequence[Sequence[Any]], limit_s: float) -> list[int]:
        first = len(self.given)
        for flights in batches:
            self.given.append(tuple(one.key() for one in flights))
            self.out[len(self.given)] = tuple(flights)
        self.max_out = max(self.max_out, len(self.out))
        return list(range(first + 1, len(self.given) + 1))

    def came(self, wait_s: float) -> list[Came]:
        if self.loses:
            self.loses -= 1
            lost, self.out = list(self.out), {}
            return [Came(task) for task in lost]
        if any(one.how == "kills" for flights in self.out.values() for one in flights):
            died, self.out = list(self.out), {}  # all of it was on one machine
            return [Came(task, broke="it died") for task in died]
        task = next(iter(self.out))
        flights = self.out.pop(task)
        rows = tuple(
            one.broken("no such wind") if one.how == "raises" else StubRow(one.number)
            for one in flights
        )
        return [Came(task, rows, self.took_s * len(flights))]


def fly(cluster: OwnCluster, flights: list[StubFlight], tries: int = 3) -> dict[str, StubRow]:
    found: dict[str, StubRow] = {}
    dispatch = Dispatch[StubRow](cluster, _distinct(flights), tries, 60.0)
    for rows in dispatch.rows():
        for key, row in rows:
            assert key not in found, "a row came twice"
            found[key] = row
    return found


def test_no_more_is_out_than_two_tasks_a_thread() -> None:
    cluster = OwnCluster(threads=3)
    rows = fly(cluster, [StubFlight(i) for i in range(50)])
    assert {row.number for row in rows.values()} == set(range(50))
    assert cluster.max_out == 6


def test_flights_are_taken_as_they_are_needed() -> None:
    taken = []

    def flights() -> Any:
        for i in range(1000):
            taken.append(i)
            yield f"{i}", StubFlight(i)

    cluster = OwnCluster()
    dispatch = Dispatch[StubRow](cluster, flights(), 3, 60.0)
    next(dispatch.rows())
    assert len(taken) <= 5


def test_fast_flights_go_in_batches_and_slow_ones_do_not() -> None:
    fast, slow = OwnCluster(threads=100, took_s=0.02), OwnCluster(threads=100, took_s=1.0)
    flights = [StubFlight(i) for i in range(3000)]
    assert len(fly(fast, flights)) == len(fly(slow, flights)) == 3000
    assert max(len(keys) for keys in fast.given) in (50, 51)  # 100 tasks a second
    assert max(len(keys) for keys in slow.given) == 1


def test_a_flight_that_raises_is_tried_again_and_then_a_row_with_the_reason() -> None:
    cluster = OwnCluster()
    rows = fly(cluster, [StubFlight(0, "raises"), StubFlight(1)])
    assert cluster.given.count(("raises 0",)) == 3
    assert rows["raises 0"].error
    assert rows["raises 0"].reason == "no such wind"
    assert not rows["flies 1"].error


def test_a_flight_that_kills_is_found_and_no_other_is_blamed() -> None:
    cluster = OwnCluster()
    rows = fly(cluster, [*(StubFlight(i) for i in range(20)), StubFlight(20, "kills")])
    assert [key for key, row in rows.items() if row.error] == ["kills 20"]
    assert rows["kills 20"].reason == "it died; tried 3 times"
    assert len(rows) == 21
    assert cluster.given.count(("kills 20",)) == 3


def test_two_flights_that_kill_are_both_found() -> None:
    flights = [StubFlight(i, "kills" if i in (3, 4) else "flies") for i in range(12)]
    rows = fly(OwnCluster(), flights)
    assert sorted(key for key, row in rows.items() if row.error) == ["kills 3", "kills 4"]
    assert len(rows) == 12


def test_what_is_lost_with_a_scheduler_is_flown_again_and_not_counted_as_broken() -> None:
    cluster = OwnCluster()
    cluster.loses = 7
    rows = fly(cluster, [StubFlight(i) for i in range(20)])
    assert len(rows) == 20
    assert not any(row.error for row in rows.values())
