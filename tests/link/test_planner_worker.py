"""Latency is counted in ticks inline, and never blocks in a thread."""

from __future__ import annotations

import threading
import time

import pytest

from fsw.runtime import clock
from fsw.runtime.planner_worker import InlinePlanner, PlannerRecord, ThreadedPlanner
from fsw.runtime.timing import GroupTimer
from fsw.signals import (
    Plan,
    PlanFailure,
    PlanRequest,
    PlanTimings,
    PredictionState,
    SafeSet,
    SolverStatus,
)

REST = PredictionState(
    (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 2, (0.0,) * 2, 0.0, 0.0, (0.0,) * 2, (0.0,) * 2
)  # fmt: skip


def request(plan_id: int, t_apply_us: int = 1_010_000) -> PlanRequest:
    return PlanRequest(plan_id, t_apply_us, REST, (), SafeSet(), False)


class Refusing:
    """A planner that answers everything with a failure, after a gate has opened."""

    def __init__(self) -> None:
        self.gate = threading.Event()
        self.gate.set()
        self.asked: list[int] = []

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        self.asked.append(request.plan_id)
        assert self.gate.wait(5.0)
        return PlanFailure(
            request.plan_id, SolverStatus.INFEASIBLE, "no", PlanTimings(0.0, 0.0, 0.0)
        )


class Raising:
    """A planner with a bug."""

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        raise ZeroDivisionError("a bug")


@pytest.fixture
def record() -> PlannerRecord:
    return PlannerRecord(GroupTimer(100_000))


def wait_for(condition: object) -> None:
    until = time.monotonic() + 5.0
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < until
        time.sleep(0.001)


def test_inline_the_answer_waits_for_its_tick(record: PlannerRecord) -> None:
    service = InlinePlanner(Refusing(), clock.now_us, record)
    service.submit(request(1))
    assert service.take(1_008_000) is None
    answer = service.take(1_010_000)
    assert answer is not None
    assert answer.plan_id == 1
    assert service.take(1_012_000) is None
    assert record.status == {"infeasible": 1}
    assert record.timer.ticks == 1


def test_a_planner_that_raises_is_a_failed_cycle(record: PlannerRecord) -> None:
    service = InlinePlanner(Raising(), clock.now_us, record)
    service.submit(request(1))
    answer = service.take(1_010_000)
    assert isinstance(answer, PlanFailure)
    assert answer.status is SolverStatus.NUMERICAL_ERROR
    assert "ZeroDivisionError" in answer.reason


def test_in_a_thread_submit_and_take_never_wait(record: PlannerRecord) -> None:
    planner = Refusing()
    planner.gate.clear()
    service = ThreadedPlanner(planner, clock.now_us, record)
    begin = time.monotonic()
    service.submit(request(1))
    assert service.take(9_000_000) is None
    assert time.monotonic() - begin < 1.0
    planner.gate.set()
    answers: list[Plan | PlanFailure] = []
    wait_for(lambda: answers.append(a) or True if (a := service.take(9_000_000)) else False)
    assert answers[0].plan_id == 1
    service.close()


def test_the_newest_request_replaces_one_that_was_not_started(record: PlannerRecord) -> None:
    planner = Refusing()
    planner.gate.clear()
    service = ThreadedPlanner(planner, clock.now_us, record)
    service.submit(request(1))
    wait_for(lambda: planner.asked == [1])
    service.submit(request(2))
    service.submit(request(3))
    planner.gate.set()
    wait_for(lambda: planner.asked[-1] == 3)
    assert planner.asked == [1, 3]
    service.close()
