"""The planner behind submit and take: inline for lockstep, a thread for real time.

Either way an answer is handed out on the first tick whose time has reached the request's
``t_apply_us``: the latency of the planner is a number of ticks, never wall time, so a flight in
lockstep is the same on every machine.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from dataclasses import dataclass, field

from fsw.ports import Clock, Planner
from fsw.runtime.process import PLANNER_PRIORITY, claim_real_time
from fsw.runtime.timing import GroupTimer
from fsw.signals import Plan, PlanFailure, PlanRequest, PlanTimings, SolverStatus


@dataclass(slots=True)
class PlannerRecord:
    """What the planner did in this flight."""

    timer: GroupTimer
    status: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True, slots=True)
class _Answer:
    """A finished cycle."""

    t_apply_us: int
    result: Plan | PlanFailure
    duration_us: int


class InlinePlanner:
    """Plans at once, in the caller's thread; the answer waits for its tick."""

    def __init__(self, planner: Planner, clock: Clock, record: PlannerRecord) -> None:
        self._planner = planner
        self._clock = clock
        self._record = record
        self._answer: _Answer | None = None

    def submit(self, request: PlanRequest) -> None:
        """Plan now."""
        self._answer = _plan(self._planner, self._clock, request)

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """Hand out the answer once its time has come."""
        answer = self._answer
        if answer is None or t_us < answer.t_apply_us:
            return None
        self._answer = None
        return _counted(answer, self._record)

    def close(self) -> None:
        """Nothing to stop."""


class ThreadedPlanner:
    """Plans in a thread; the newest request replaces one that has not been started.

    Assembly holds the GIL for short stretches only and the solver releases it, so the tick of
    the main thread gets in between.
    """

    def __init__(self, planner: Planner, clock: Clock, record: PlannerRecord) -> None:
        self._planner = planner
        self._clock = clock
        self._record = record
        self._wanted = threading.Event()
        # Appending and popping a deque is atomic; the newest replaces what nobody took.
        self._requests: deque[PlanRequest] = deque(maxlen=1)
        self._answers: deque[_Answer] = deque(maxlen=1)
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="planner", daemon=True)
        self._thread.start()

    def submit(self, request: PlanRequest) -> None:
        """Leave a request for the thread; never waits."""
        self._requests.append(request)
        self._wanted.set()

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """Hand out the newest answer that is there and due."""
        try:
            if t_us < self._answers[0].t_apply_us:
                return None
            # Only this thread takes: what replaced the answer just looked at is newer.
            answer = self._answers.pop()
        except IndexError:
            return None
        return _counted(answer, self._record)

    def close(self) -> None:
        """Let the thread end after the cycle under way."""
        self._closing = True
        self._wanted.set()
        self._thread.join(timeout=1.0)

    def _work(self) -> None:
        claim_real_time(PLANNER_PRIORITY)
        while True:
            self._wanted.wait()
            self._wanted.clear()
            if self._closing:
                return
            try:
                request = self._requests.pop()
            except IndexError:
                continue
            self._answers.append(_plan(self._planner, self._clock, request))


def _plan(planner: Planner, clock: Clock, request: PlanRequest) -> _Answer:
    begin = clock()
    try:
        result = planner.plan(request)
    except Exception as error:
        # A planner that raises must not take the fast loop with it: to the tick it is one more
        # failed cycle, and the running plan goes on.
        reason = f"planner raised {type(error).__name__}: {error}"
        nothing = PlanTimings(0.0, 0.0, 0.0)
        result = PlanFailure(request.plan_id, SolverStatus.NUMERICAL_ERROR, reason, nothing)
    return _Answer(request.t_apply_us, result, clock() - begin)


def _counted(answer: _Answer, record: PlannerRecord) -> Plan | PlanFailure:
    record.timer.add(answer.duration_us)
    record.status[answer.result.status.name.lower()] += 1
    return answer.result
