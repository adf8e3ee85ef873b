r"""The planner behind submit and take: inline for lockstep, in a process of its own in real time.

Either way an answer is handed out on the first tick whose time has reached the request's
``t_apply_us``: the latency of the planner is a number of ticks, never wall time, so a flight in
lockstep is the same on every machine. In real time there are three processes:

    tick process  ==request, answer==  worker
          \-- forks -- fork server -- forks --/

The fork server is forked when everything has been compiled and warmed up, and only waits for its
worker to end. It replaces a worker that dies in milliseconds, without a fork in the tick process;
the new worker reads on from the same link. All end with the process that they serve.

Why not ``multiprocessing``: docs/decisions/0024-planner-process.md.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import socket
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, NoReturn

from fsw.autopilot.ports import Clock, PlanningCycle
from fsw.autopilot.signals import Plan, PlanFailure, PlanRequest, PlanTimings, SolverStatus
from fsw.runtime.process import PLANNER_PRIORITY, claim_real_time, die_with_parent
from fsw.runtime.timing import GroupTimer

# The limit of a solve in wall time: a planner process that is silent for longer is replaced.
ANSWER_TIMEOUT_US: Final = 500_000
_RESTART_DELAY_S: Final = 0.02  # the next worker might die at once as well
_MAX_BYTES: Final = 1 << 17  # of one value; a request has about 2 kB


@dataclass(frozen=True, slots=True)
class Answer:
    """A finished cycle; times on the clock that all processes share."""

    t_apply_us: int
    result: Plan | PlanFailure
    begun_us: int
    duration_us: int


@dataclass(frozen=True, slots=True)
class WorkerStarted:
    """The fork server has forked a worker."""

    process: int


@dataclass(frozen=True, slots=True)
class WorkerExited:
    """A worker has ended without being asked to."""

    exit_code: int  # negative: the signal


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


class PeerGone(Exception):
    """The other process has ended."""


class ProcessLink:
    """One end of a pair of connected local sockets that keep message boundaries.

    A value arrives whole or not at all, even if either side is killed while it writes, and the end
    of a side is noticed at once.
    """

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self.fileno = end.fileno
        self.close = end.close  # the other side notices

    def send(self, value: object) -> None:
        """Send a value; it is dropped if the other side has not read for long.

        ``PeerGone`` if the other process has ended.
        """
        try:
            self._socket.send(pickle.dumps(value, pickle.HIGHEST_PROTOCOL), socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError:
            raise PeerGone from None

    def receive(self, *, wait: bool) -> Any:
        """The next value; None if there is none and ``wait`` is False.

        ``PeerGone`` if the other process has ended, and nothing that it sent is left.
        """
        try:
            message = self._socket.recv(_MAX_BYTES, 0 if wait else socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None
        except ConnectionError:
            raise PeerGone from None
        if not message:
            raise PeerGone
        return pickle.loads(message)


def start_fork_server(planner: PlanningCycle, clock: Clock) -> tuple[int, ProcessLink]:
    """Fork the fork server; returns its process number and our end of the link."""
    ours, theirs = map(ProcessLink, socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET))
    server = _fork(lambda: _serve(planner, clock, theirs), theirs)
    theirs.close()
    return server, ours


def answer(planner: PlanningCycle, clock: Clock, request: PlanRequest) -> Answer:
    """Plan; an error of the planner is a failed cycle, and the current plan goes on."""
    begin = clock()
    try:
        result = planner.plan(request)
    except Exception as error:
        reason = f"planner raised {type(error).__name__}: {error}"
        unmeasured = PlanTimings(0.0, 0.0, 0.0)
        result = PlanFailure(request.plan_id, SolverStatus.NUMERICAL_ERROR, reason, unmeasured)
    return Answer(request.t_apply_us, result, begin, clock() - begin)


def _serve(planner: PlanningCycle, clock: Clock, link: ProcessLink) -> None:
    """Keep one worker alive until the tick process has ended."""
    claim_real_time(PLANNER_PRIORITY)
    while True:
        worker = _fork(lambda: _work(planner, clock, link), link)
        link.send(WorkerStarted(worker))
        exit_code = os.waitstatus_to_exitcode(os.waitpid(worker, 0)[1])
        if exit_code == 0:
            return
        link.send(WorkerExited(exit_code))
        time.sleep(_RESTART_DELAY_S)


def _work(planner: PlanningCycle, clock: Clock, link: ProcessLink) -> None:
    """Answer requests, always the newest, until the tick process has ended."""
    claim_real_time(PLANNER_PRIORITY)
    while True:
        request: PlanRequest = link.receive(wait=True)
        while (newer := link.receive(wait=False)) is not None:
            request = newer
        link.send(answer(planner, clock, request))


def _fork(run: Callable[[], None], link: ProcessLink) -> int:
    """Run in a new process that has nothing of this one's but its memory and ``link``."""
    parent = os.getpid()
    return os.fork() or _run_forked(run, parent, link)


def _run_forked(run: Callable[[], None], parent: int, link: ProcessLink) -> NoReturn:
    code = 1
    try:
        die_with_parent(parent)
        # The terminal's interrupt goes to all processes; these end with their link.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        _close_all_but(link.fileno())
        run()
        code = 0
    except PeerGone:
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)  # the parent's buffers are not written twice, its handlers do not run


def _close_all_but(kept: int) -> None:
    """Close what was inherited: ports and logs belong to the parent alone."""
    null = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1):
        os.dup2(null, standard)
    os.closerange(3, kept)
    os.closerange(kept + 1, os.sysconf("SC_OPEN_MAX"))
