"""Latency is counted in ticks inline; the planner's process never blocks and never stays behind."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fsw.runtime import clock, planner_worker
from fsw.runtime.planner_worker import InlinePlanner, PlannerRecord, ProcessPlanner
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
from tests.waiting import wait_for

REST = PredictionState(
    (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 2, (0.0,) * 2, 0.0, 0.0, (0.0,) * 2, (0.0,) * 2
)  # fmt: skip
CRASH, HANG, ALWAYS_US = 666, 667, 9_000_000


def request(plan_id: int, t_apply_us: int = 1_010_000) -> PlanRequest:
    return PlanRequest(plan_id, t_apply_us, REST, (), SafeSet(), False)


class Refusing:
    """Answers everything with a failure; two numbers it does not survive."""

    def __init__(self, gate: Path | None = None) -> None:
        self._gate = gate

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        if self._gate is not None:
            self._gate.with_name("at-work").touch()
        if request.plan_id == CRASH:
            os.kill(os.getpid(), signal.SIGSEGV)
        while request.plan_id == HANG or (self._gate is not None and not self._gate.exists()):
            time.sleep(0.001)
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


@pytest.fixture
def service(record: PlannerRecord) -> Iterator[ProcessPlanner]:
    planner = ProcessPlanner(Refusing(), clock.now_us, record)
    yield planner
    planner.close()


def answer(service: ProcessPlanner, t_us: int = ALWAYS_US) -> Plan | PlanFailure:
    given = wait_for(lambda: service.take(t_us))
    assert given is not None
    return given


def answers_until(service: ProcessPlanner, last: Callable[[int], bool]) -> list[int]:
    """The plans that are answered, up to and with one."""
    given = [answer(service).plan_id]
    while not last(given[-1]):
        given.append(answer(service).plan_id)
    return given


def processes_of(service: ProcessPlanner) -> tuple[int, int]:
    """The worker and its nursery, once a request was answered."""
    service.submit(request(1))
    answer(service)
    worker = service.worker
    assert worker is not None
    return worker, parent_of(worker)


def parent_of(process: int) -> int:
    return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])


def is_gone(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return True
    return state == "Z"


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


def test_the_process_s_answer_waits_for_its_tick_too(
    service: ProcessPlanner, record: PlannerRecord
) -> None:
    service.submit(request(1))
    until = time.monotonic() + 0.3
    while time.monotonic() < until:
        assert service.take(1_008_000) is None
    given = answer(service, 1_010_000)
    assert given == PlanFailure(1, SolverStatus.INFEASIBLE, "no", PlanTimings(0.0, 0.0, 0.0))
    assert service.take(ALWAYS_US) is None
    assert record.timer.ticks == 1


def test_submit_and_take_never_wait_and_the_newest_request_is_next(
    record: PlannerRecord, tmp_path: Path
) -> None:
    gate = tmp_path / "open"
    service = ProcessPlanner(Refusing(gate), clock.now_us, record)
    service.submit(request(1))
    wait_for((tmp_path / "at-work").exists)
    begin = time.monotonic()
    for plan_id in range(2, 2000):  # far more than the link holds
        service.submit(request(plan_id))
        assert service.take(ALWAYS_US) is None
    assert time.monotonic() - begin < 2.0
    gate.touch()
    # Of all that was asked meanwhile only the newest that the link held is planned.
    given = answers_until(service, lambda plan_id: plan_id > 1)
    assert given[-1] > 100
    assert given[:-1] in ([], [1])
    service.close()


def test_an_answer_that_comes_behind_another_question_does_not_hide_the_next(
    record: PlannerRecord, tmp_path: Path
) -> None:
    gate = tmp_path / "open"
    service = ProcessPlanner(Refusing(gate), clock.now_us, record)
    service.submit(request(1))
    wait_for((tmp_path / "at-work").exists)
    service.submit(request(2))
    gate.touch()
    assert answers_until(service, lambda plan_id: plan_id == 2)[:-1] in ([], [1])
    service.close()


def test_a_worker_that_dies_is_replaced_and_the_event_told(
    service: ProcessPlanner, record: PlannerRecord
) -> None:
    service.submit(request(1))
    answer(service)
    first = service.worker
    assert first is not None
    os.kill(first, signal.SIGKILL)
    wait_for(lambda: is_gone(first))
    service.submit(request(2))
    assert answer(service).plan_id == 2
    assert service.worker not in (None, first)
    assert record.restarts == 1
    assert record.events == ["planner process died (-9), restart 1"]


def test_a_request_that_kills_its_worker_is_lost_and_the_next_is_answered(
    service: ProcessPlanner, record: PlannerRecord
) -> None:
    service.submit(request(CRASH))
    wait_for(lambda: service.take(ALWAYS_US) or record.restarts)
    service.submit(request(3))
    assert answer(service).plan_id == 3
    assert record.events == ["planner process died (-11), restart 1"]


def test_a_nursery_that_dies_takes_its_worker_along_and_both_are_replaced(
    service: ProcessPlanner, record: PlannerRecord
) -> None:
    first, nursery = processes_of(service)
    os.kill(nursery, signal.SIGKILL)
    wait_for(lambda: is_gone(first))
    service.submit(request(2))
    service.take(ALWAYS_US)
    service.submit(request(3))
    assert answer(service).plan_id in (2, 3)
    assert record.restarts == 1


def test_a_worker_that_is_stuck_is_replaced(
    service: ProcessPlanner, record: PlannerRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(planner_worker, "PATIENCE_US", 200_000)
    service.submit(request(HANG))
    wait_for(lambda: service.take(ALWAYS_US) or record.restarts)
    service.submit(request(4))
    assert answer(service).plan_id == 4


def test_a_nursery_that_is_stuck_is_replaced_with_its_worker(
    service: ProcessPlanner, record: PlannerRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(planner_worker, "PATIENCE_US", 200_000)
    worker, nursery = processes_of(service)
    os.kill(nursery, signal.SIGSTOP)
    os.kill(worker, signal.SIGKILL)
    service.submit(request(2))
    wait_for(lambda: service.take(ALWAYS_US) or record.restarts)
    assert record.events == ["planner processes died, restart 1"]
    service.submit(request(3))
    assert answer(service).plan_id == 3


def test_every_cycle_is_measured_and_what_was_never_answered_is_skipped(
    record: PlannerRecord, tmp_path: Path
) -> None:
    gate = tmp_path / "open"
    service = ProcessPlanner(Refusing(gate), clock.now_us, record)
    service.submit(request(1))
    wait_for((tmp_path / "at-work").exists)
    time.sleep(0.15)  # at work on it for longer than its period
    for plan_id in (2, 3, 4):
        service.submit(request(plan_id))
    gate.touch()
    assert answers_until(service, lambda plan_id: plan_id == 4)[:-1] in ([], [1])
    timing = record.timer.close_interval()
    assert (timing.ticks, timing.late_ticks, timing.skipped_ticks) == (2, 1, 2)
    assert timing.execution_max_us > 100_000.0
    assert record.status == {"infeasible": 2}
    service.close()


def test_nothing_is_left_of_it(record: PlannerRecord) -> None:
    service = ProcessPlanner(Refusing(), clock.now_us, record)
    worker, nursery = processes_of(service)
    service.close()
    service.close()
    assert is_gone(nursery)
    wait_for(lambda: is_gone(worker))


def test_a_parent_that_is_killed_leaves_no_orphans() -> None:
    reading, writing = os.pipe()
    parent = os.fork()
    if parent == 0:
        service = ProcessPlanner(Refusing(), clock.now_us, PlannerRecord(GroupTimer(100_000)))
        service.submit(request(1))
        answer(service)
        assert service.worker is not None
        os.write(writing, f"{service.worker} {parent_of(service.worker)}".encode())
        time.sleep(60.0)
        os._exit(0)
    os.close(writing)
    worker, nursery = map(int, os.read(reading, 100).split())
    os.close(reading)
    os.kill(parent, signal.SIGKILL)
    os.waitpid(parent, 0)
    wait_for(lambda: is_gone(worker) and is_gone(nursery))
