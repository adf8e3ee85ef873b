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

from fsw.ports import Clock, PlanningCycle
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

    def count(self, given: Answer, asked_us: int) -> None:
        """Count a cycle by its answer."""
        self.timer.add(given.duration_us, max(given.begun_us - asked_us, 0))
        self.status[given.result.status.name.lower()] += 1


class InlinePlanner:
    """Plans at once, in the caller's process; the answer waits for its tick."""

    def __init__(self, planner: PlanningCycle, clock: Clock, record: PlannerRecord) -> None:
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
        self._record.count(given, given.begun_us)
        return given.result

    def close(self) -> None:
        """Nothing to stop."""


class ProcessPlanner:
    """Asks the worker process; the newest request replaces one that has not been started."""

    def __init__(self, planner: PlanningCycle, clock: Clock, record: PlannerRecord) -> None:
        """Start the processes; do it early, before there are threads and open files."""
        self.worker: int | None = None  # its process, once it has said so
        self._planner = planner
        self._clock = clock
        self._record = record
        self._nursery: int | None
        self._nursery, self._link = start(planner, clock)
        self._answer: Answer | None = None
        self._asked_us: dict[int, int] = {}  # when which requests were sent that are open
        self._silent_since_us: int | None = None  # while something is to be heard
        self._stuck = 0  # times in a row that patience was over

    def submit(self, request: PlanRequest) -> None:
        """Hand a request over; never waits."""
        now_us = self._clock()
        self._asked_us[request.plan_id] = now_us
        if self._silent_since_us is None:
            self._silent_since_us = now_us
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
        return given.result

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
            self._end_stuck()

    def _hear(self, said: Answer | Born | Died) -> None:
        self._stuck = 0
        if isinstance(said, Answer):
            self._answer = said
            self._settle(said)
            self._silent_since_us = self._clock() if self._asked_us else None
        elif isinstance(said, Born):
            self.worker = said.process
        else:
            self._record.restarted(f"planner process died ({said.exit_code})")

    def _settle(self, given: Answer) -> None:
        """Count an answer, and what was asked before it as skipped: the newest goes first."""
        plan_id = given.result.plan_id
        self._record.count(given, self._asked_us.get(plan_id, given.begun_us))
        older = sum(asked < plan_id for asked in self._asked_us)
        self._record.timer.skipped += older
        self._asked_us = {one: at for one, at in self._asked_us.items() if one > plan_id}

    def _end_stuck(self) -> None:
        """Kill a worker that does not answer; its nursery starts another one and says so.

        A nursery that does not, is killed the next time, and the worker with it.
        """
        self._silent_since_us = self._clock()
        self._stuck += 1
        stuck = self.worker if self._stuck == 1 else self._nursery
        if stuck is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(stuck, signal.SIGKILL)

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
        self._silent_since_us, self._stuck = None, 0
        self._record.restarted("planner processes died")
