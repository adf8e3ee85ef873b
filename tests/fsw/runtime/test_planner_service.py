"""Latency is counted in ticks inline; the planner's process never blocks and never falls behind."""

from __future__ import annotations

import mmap
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from fsw.autopilot.signals import (
    Plan,
    PlanFailure,
    PlanRequest,
    PlanTimings,
    PredictionState,
    SafeSet,
    SolverStatus,
)
from fsw.runtime.planner_service import (
    ANSWER_TIMEOUT_US,
    InlinePlanner,
    PlannerRecord,
    ProcessPlanner,
)
from fsw.runtime.timing import GroupTimer
from tests.waiting import wait_for

REST = PredictionState(
    (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 2, (0.0,) * 2, 0.0, 0.0, (0.0,) * 2, (0.0,) * 2
)  # fmt: skip
CRASH, HANG, ALWAYS_US = 666, 667, 9_000_000


def request(plan_id: int, t_apply_us: int = 1_010_000) -> PlanRequest:
    return PlanRequest(plan_id, t_apply_us, REST, (), SafeSet(), False)


class SharedClock:
    """Moved by hand, and read by the worker too [us]."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, 8)  # shared with forked processes
        self.advance(1_000_000)

    def __call__(self) -> int:
        return int.from_bytes(self._memory[:8], "big")

    def advance(self, step_us: int) -> None:
        self._memory[:8] = (self() + step_us).to_bytes(8, "big")


class Refusing:
    """Answers everything with a failure; one number kills it, another makes it hang.

    With a gate it creates the file ``at-work`` beside it, and answers when the gate exists.
    """

    def __init__(self, gate: Path | None = None) -> None:
        self._gate = gate

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        if self._gate is not None:
            self._gate.with_name("at-work").touch()
            wait_for(self._gate.exists)
        if request.plan_id == CRASH:
            os.kill(os.getpid(), signal.SIGSEGV)
        while request.plan_id == HANG:
            signal.pause()
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
def clock() -> SharedClock:
    return SharedClock()


@pytest.fixture
def service(record: PlannerRecord, clock: SharedClock) -> Iterator[ProcessPlanner]:
    planner = ProcessPlanner(Refusing(), clock, record)
    yield planner
    planner.close()


@pytest.fixture
def gate(tmp_path: Path) -> Path:
    return tmp_path / "open"


@pytest.fixture
def gated(record: PlannerRecord, clock: SharedClock, gate: Path) -> Iterator[ProcessPlanner]:
    """At work on request 1 until the gate is created."""
    planner = ProcessPlanner(Refusing(gate), clock, record)
    planner.submit(request(1))
    wait_for(gate.with_name("at-work").exists)
    yield planner
    planner.close()


def answer(service: ProcessPlanner) -> Plan | PlanFailure:
    given = wait_for(lambda: service.take(ALWAYS_US))
    assert given is not None
    return given


def processes_of(service: ProcessPlanner) -> tuple[int, int]:
    """The worker and its fork server, once a request was answered."""
    service.submit(request(1))
    answer(service)
    worker, server = service.worker, service.fork_server
    assert worker is not None
    assert server is not None
    return worker, server


def is_gone(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return True
    return state == "Z"


def test_inline_the_answer_waits_for_its_tick(record: PlannerRecord, clock: SharedClock) -> None:
    service = InlinePlanner(Refusing(), clock, record)
    service.submit(request(1))
    assert service.take(1_008_000) is None
    answer = service.take(1_010_000)
    assert answer is not None
    assert answer.plan_id == 1
    assert service.take(1_012_000) is None
    assert record.status == {"infeasible": 1}
    assert record.timer.ticks == 1


def test_a_planner_that_raises_is_a_failed_cycle(record: PlannerRecord, clock: SharedClock) -> None:
    service = InlinePlanner(Raising(), clock, record)
    service.submit(request(1))
    answer = service.take(1_010_000)
    assert isinstance(answer, PlanFailure)
    assert answer.status is SolverStatus.NUMERICAL_ERROR
    assert "ZeroDivisionError" in answer.reason


def test_the_process_s_answer_waits_for_its_tick_too(
    service: ProcessPlanner, record: PlannerRecord
) -> None:
    service.submit(request(1))
    early: list[object] = []
    wait_for(lambda: early.append(service.take(1_008_000)) or record.timer.ticks)  # it has arrived
    assert set(early) == {None}
    given = service.take(1_010_000)
    assert given == PlanFailure(1, SolverStatus.INFEASIBLE, "no", PlanTimings(0.0, 0.0, 0.0))
    assert service.take(ALWAYS_US) is None


@pytest.mark.requirement("REQ-PLAN-4")
def test_submit_and_take_never_wait_and_the_newest_request_is_next(
    gated: ProcessPlanner, record: PlannerRecord, gate: Path
) -> None:
    for plan_id in range(2, 2000):  # far more than the link holds; the worker would not read on
        gated.submit(request(plan_id))
        assert gated.take(ALWAYS_US) is None
    assert not gate.exists()
    gate.touch()
    wait_for(lambda: gated.take(ALWAYS_US) is not None and record.timer.ticks == 2)
    assert record.timer.skipped > 100


def test_an_answer_that_comes_behind_another_request_does_not_hide_the_next(
    gated: ProcessPlanner, gate: Path
) -> None:
    gated.submit(request(2))
    gate.touch()
    given = [answer(gated).plan_id]
    while given[-1] != 2:
        given.append(answer(gated).plan_id)


@pytest.mark.requirement("REQ-PLAN-4")
def test_a_worker_that_dies_is_replaced_and_reported(
    service: ProcessPlanner, record: PlannerRecord
) -> None:
    first, server = processes_of(service)
    os.kill(first, signal.SIGKILL)
    wait_for(lambda: is_gone(first))
    service.submit(request(2))
    assert answer(service).plan_id == 2
    assert service.worker not in (None, first)
    assert service.fork_server == server
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


@pytest.mark.requirement("REQ-PLAN-4")
def test_a_fork_server_that_dies_takes_its_worker_along_and_both_are_replaced(
    service: ProcessPlanner, record: PlannerRecord
) -> None:
    first, server = processes_of(service)
    os.kill(server, signal.SIGKILL)
    wait_for(lambda: is_gone(first))
    service.submit(request(2))
    service.take(ALWAYS_US)
    service.submit(request(3))
    assert answer(service).plan_id in (2, 3)
    assert record.restarts == 1


@pytest.mark.requirement("REQ-PLAN-4")
def test_a_worker_that_hangs_is_replaced(
    service: ProcessPlanner, record: PlannerRecord, clock: SharedClock
) -> None:
    first, server = processes_of(service)
    service.submit(request(HANG))
    clock.advance(ANSWER_TIMEOUT_US)
    assert service.take(ALWAYS_US) is None
    assert not is_gone(first)
    clock.advance(1)
    wait_for(lambda: service.take(ALWAYS_US) or record.restarts)
    service.submit(request(4))
    assert answer(service).plan_id == 4
    assert is_gone(first)
    assert service.fork_server == server


@pytest.mark.requirement("REQ-PLAN-4")
def test_a_fork_server_that_hangs_is_replaced_with_its_worker(
    service: ProcessPlanner, record: PlannerRecord, clock: SharedClock
) -> None:
    worker, server = processes_of(service)
    os.kill(server, signal.SIGSTOP)
    os.kill(worker, signal.SIGKILL)
    service.submit(request(2))
    for _ in range(2):  # the worker first, then the fork server
        clock.advance(ANSWER_TIMEOUT_US + 1)
        service.take(ALWAYS_US)
    wait_for(lambda: service.take(ALWAYS_US) or record.restarts)
    assert record.events == ["planner processes died, restart 1"]
    service.submit(request(3))
    assert answer(service).plan_id == 3


def test_every_cycle_is_measured_and_what_was_never_answered_is_skipped(
    gated: ProcessPlanner, record: PlannerRecord, clock: SharedClock, gate: Path
) -> None:
    clock.advance(150_000)  # longer than the period
    for plan_id in (2, 3, 4):
        gated.submit(request(plan_id))
    gate.touch()
    wait_for(lambda: gated.take(ALWAYS_US) is not None and record.timer.ticks == 2)
    timing = record.timer.close_interval()
    assert (timing.ticks, timing.late_ticks, timing.skipped_ticks) == (2, 1, 2)
    assert timing.execution_max_us == 150_000
    assert record.status == {"infeasible": 2}


def test_nothing_is_left_of_it(service: ProcessPlanner) -> None:
    worker, server = processes_of(service)
    service.close()
    service.close()
    assert is_gone(server)
    wait_for(lambda: is_gone(worker))


@pytest.mark.parametrize("ended_by", [signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("task", [2, HANG], ids=["idle", "busy"])
def test_a_parent_that_is_ended_leaves_no_orphans(ended_by: signal.Signals, task: int) -> None:
    reading, writing = os.pipe()
    parent = os.fork()
    if parent == 0:
        service = ProcessPlanner(Refusing(), SharedClock(), PlannerRecord(GroupTimer(100_000)))
        service.submit(request(1))
        answer(service)
        service.submit(request(task))
        os.write(writing, f"{service.worker} {service.fork_server}".encode())
        signal.pause()
        os._exit(0)
    os.close(writing)
    worker, server = map(int, os.read(reading, 100).split())
    os.close(reading)
    os.kill(parent, ended_by)
    os.waitpid(parent, 0)
    wait_for(lambda: is_gone(worker) and is_gone(server))
