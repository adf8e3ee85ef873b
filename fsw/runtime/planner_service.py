"""The planner behind submit and take: inline for lockstep, in a process of its own in real time.

Either way an answer is handed out on the first tick whose time has reached the request's
``t_apply_us``: the latency of the planner is a number of ticks, never wall time, so a flight in
lockstep is the same on every machine.
"""

from __future__ import annotations

import contextlib
import os
import signal
from collections import Counter
from dataclasses import dataclass, field
from typing import Final

from fsw.autopilot.ports import Clock, PlanningCycle
from fsw.autopilot.signals import Plan, PlanFailure, PlanRequest
from fsw.runtime.planner_process import (
    Answer,
    PeerGone,
    WorkerExited,
    WorkerStarted,
    answer,
    start_fork_server,
)
from fsw.runtime.timing import GroupTimer

# The limit of a solve in wall time: a planner process that is silent for longer is replaced.
ANSWER_TIMEOUT_US: Final = 500_000


@dataclass(slots=True)
class PlannerRecord:
    """What the planner did in this flight."""

    timer: GroupTimer
    status: Counter[str] = field(default_factory=Counter)
    restarts: int = 0
    events: list[str] = field(default_factory=list)  # not yet reported to the operator

    def restarted(self, why: str) -> None:
        """Count a new process and leave a sentence for the operator."""
        self.restarts += 1
        self.events.append(f"{why}, restart {self.restarts}")

    def count(self, given: Answer, sent_us: int) -> None:
        """Count a cycle by its answer; ``sent_us`` is when it was requested [us, monotonic]."""
        self.timer.add(given.duration_us, max(given.begun_us - sent_us, 0))
        self.status[given.result.status.name.lower()] += 1


@dataclass
class InlinePlanner:
    """Plans at once, in the caller's process; the answer waits for its tick."""

    planner: PlanningCycle
    clock: Clock
    record: PlannerRecord
    _answer: Answer | None = None

    def submit(self, request: PlanRequest) -> None:
        """Plan now."""
        self._answer = answer(self.planner, self.clock, request)

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """The answer, once, at or after the time from which it applies [us]."""
        given = self._answer
        if given is None or t_us < given.t_apply_us:
            return None
        self._answer = None
        self.record.count(given, given.begun_us)
        return given.result

    def close(self) -> None:
        """Nothing to stop."""


class ProcessPlanner:
    """Sends requests to the worker; the newest replaces one that has not been started."""

    def __init__(self, planner: PlanningCycle, clock: Clock, record: PlannerRecord) -> None:
        """Start the processes; do it early, before there are threads and open files."""
        self.worker: int | None = None  # process number, once it has been reported
        self.fork_server: int | None  # process number; None when closed
        self.fork_server, self._link = start_fork_server(planner, clock)
        self._planner = planner
        self._clock = clock
        self._record = record
        self._answer: Answer | None = None
        self._sent_us: dict[int, int] = {}  # of the open requests, by plan
        self._silent_since_us: int | None = None  # while an answer is due
        self._timeouts = 0  # in a row

    def submit(self, request: PlanRequest) -> None:
        """Send a request; never waits."""
        now_us = self._clock()
        self._sent_us[request.plan_id] = now_us
        if self._silent_since_us is None:
            self._silent_since_us = now_us
        try:
            self._link.send(request)
        except PeerGone:
            self._restart()

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """The newest answer, once, at or after the time from which it applies [us]."""
        if self._silent_since_us is not None:
            self._receive()
        given = self._answer
        if given is None or t_us < given.t_apply_us:
            return None
        self._answer = None
        return given.result

    def close(self) -> None:
        """End both processes; safe to call twice."""
        if self.fork_server is None:
            return
        server, self.fork_server = self.fork_server, None
        self._link.close()
        os.kill(server, signal.SIGKILL)  # and the worker with it
        os.waitpid(server, 0)

    def _receive(self) -> None:
        try:
            while (message := self._link.receive(wait=False)) is not None:
                self._handle(message)
        except PeerGone:
            self._restart()
            return
        since_us = self._silent_since_us
        if since_us is not None and self._clock() - since_us > ANSWER_TIMEOUT_US:
            self._kill_silent()

    def _handle(self, message: Answer | WorkerStarted | WorkerExited) -> None:
        self._timeouts = 0
        match message:
            case Answer():
                self._answer = message
                self._count(message)
                self._silent_since_us = self._clock() if self._sent_us else None
            case WorkerStarted():
                self.worker = message.process
            case WorkerExited():
                self._record.restarted(f"planner process died ({message.exit_code})")

    def _count(self, given: Answer) -> None:
        """Count an answer; requests before it are skipped, as the newest goes first."""
        plan_id = given.result.plan_id
        self._record.count(given, self._sent_us.get(plan_id, given.begun_us))
        self._record.timer.skipped += sum(sent < plan_id for sent in self._sent_us)
        self._sent_us = {sent: at for sent, at in self._sent_us.items() if sent > plan_id}

    def _kill_silent(self) -> None:
        """Kill the worker, which the fork server then replaces; the next time, the fork server."""
        self._silent_since_us = self._clock()
        self._timeouts += 1
        silent = self.worker if self._timeouts == 1 else self.fork_server
        if silent is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(silent, signal.SIGKILL)

    def _restart(self) -> None:
        """The fork server is gone, and its worker with it: fork both again, from this process.

        That takes milliseconds of the tick process, in which ticks are skipped; the vehicle
        follows its last plan meanwhile.
        """
        if self.fork_server is None:
            return  # closed
        self._link.close()
        os.waitpid(self.fork_server, 0)
        self.fork_server, self._link = start_fork_server(self._planner, self._clock)
        self._silent_since_us, self._timeouts = None, 0
        self._record.restarted("planner processes died")
