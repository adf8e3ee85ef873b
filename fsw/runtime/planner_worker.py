"""The planner behind submit and take: inline for lockstep, in a process of its own in real time.

Either way an answer is handed out on the first tick whose time has reached the request's
``t_apply_us``: the latency of the planner is a number of ticks, never wall time, so a flight in
lockstep is the same on every machine.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Final

from fsw.ports import Clock, Planner
from fsw.runtime.planner_process import Answer, Born, Died, answer, start
from fsw.runtime.process_link import PeerGone
from fsw.runtime.timing import GroupTimer
from fsw.signals import Plan, PlanFailure, PlanRequest

PATIENCE_US: Final = (
    500_000  # the bound of a solve in time: a silent worker is killed, and replaced
)
_FAREWELL_S: Final = 0.5


@dataclass(slots=True)
class PlannerRecord:
    """What the planner did in this flight."""

    timer: GroupTimer
    status: Counter[str] = field(default_factory=Counter)
    restarts: int = 0
    events: list[str] = field(default_factory=list)  # not yet told to the operator

    def restarted(self, why: str) -> None:
        """Count a new process and leave a sentence for the operator."""
        self.restarts += 1
        self.events.append(f"{why}, restart {self.restarts}")

    def count(self, given: Answer, asked_us: int) -> Plan | PlanFailure:
        """Count an answer that is handed out."""
        self.timer.add(given.duration_us, max(given.begun_us - asked_us, 0))
        self.status[given.result.status.name.lower()] += 1
        return given.result


class InlinePlanner:
    """Plans at once, in the caller's process; the answer waits for its tick."""

    def __init__(self, planner: Planner, clock: Clock, record: PlannerRecord) -> None:
        self._planner = planner
        self._clock = clock
        self._record = record
        self._answer: Answer | None = None

    def submit(self, request: PlanRequest) -> None:
        """Plan now."""
        self._answer = answer(self._planner, self._clock, request)

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """Hand out the answer once its time has come."""
        given = self._answer
        if given is None or t_us < given.t_apply_us:
            return None
        self._answer = None
        return self._record.count(given, given.begun_us)

    def close(self) -> None:
        """Nothing to stop."""


class ProcessPlanner:
    """Asks the worker process; the newest request replaces one that has not been started."""

    def __init__(self, planner: Planner, clock: Clock, record: PlannerRecord) -> None:
        """Start the processes; do it early, before there are threads and open files."""
        self.worker: int | None = None  # its process, once it has said so
        self._planner = planner
        self._clock = clock
        self._record = record
        self._nursery: int | None
        self._nursery, self._link = start(planner, clock)
        self._answer: Answer | None = None
        self._asked_us = 0  # when the last request was sent
        self._asked_id = -1
        self._silent_since_us: int | None = None  # while something is to be heard

    def submit(self, request: PlanRequest) -> None:
        """Hand a request over; never waits."""
        self._asked_us, self._asked_id = self._clock(), request.plan_id
        if self._silent_since_us is None:
            self._silent_since_us = self._asked_us
        try:
            self._link.send(request)
        except PeerGone:
            self._start_again()

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """Hand out the newest answer that is there and due."""
        if self._silent_since_us is not None:
            self._listen(self._silent_since_us)
        given = self._answer
        if given is None or t_us < given.t_apply_us:
            return None
        self._answer = None
        return self._record.count(given, self._asked_us)

    def close(self) -> None:
        """End both processes; safe to call twice."""
        if self._nursery is None:
            return
        nursery, self._nursery = self._nursery, None
        self._link.close()
        until = time.monotonic() + _FAREWELL_S
        while time.monotonic() < until:
            if os.waitpid(nursery, os.WNOHANG)[0]:
                return
            time.sleep(0.001)
        os.kill(nursery, signal.SIGKILL)  # and the worker with it
        os.waitpid(nursery, 0)

    def _listen(self, since_us: int) -> None:
        try:
            while (said := self._link.receive_waiting()) is not None:
                self._hear(said)
        except PeerGone:
            self._start_again()
            return
        if self._silent_since_us is not None and self._clock() - since_us > PATIENCE_US:
            self._end_stuck_worker()

    def _hear(self, said: Answer | Born | Died) -> None:
        if isinstance(said, Answer):
            self._answer = said
            answered = said.result.plan_id == self._asked_id
            self._silent_since_us = None if answered else self._clock()
        elif isinstance(said, Born):
            self.worker = said.process
        else:
            self._record.restarted(f"planner process died ({said.exit_code})")

    def _end_stuck_worker(self) -> None:
        """Kill a worker that does not answer; its nursery starts another one and says so."""
        self._silent_since_us = self._clock()
        if self.worker is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.worker, signal.SIGKILL)

    def _start_again(self) -> None:
        """The nursery is gone, and its worker with it: fork both anew, from the flying process.

        That takes milliseconds of this process's time, in which ticks are skipped; the vehicle
        follows its last plan meanwhile.
        """
        if self._nursery is None:
            return  # closed
        self._link.close()
        os.waitpid(self._nursery, 0)
        self._nursery, self._link = start(self._planner, self._clock)
        self._silent_since_us = None
        self._record.restarted("planner processes died")
