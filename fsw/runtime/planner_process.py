r"""The planner's processes: a fork server that never plans, and the worker that it forks.

    tick process  ==request, answer==  worker
          \-- forks -- fork server -- forks --/

The fork server is forked when everything has been compiled and warmed up, and only waits for its
worker to end. It replaces a worker that dies in milliseconds, without a fork in the tick process;
the new worker reads on from the same link. All end with the process that they serve.

Why not ``multiprocessing``: docs/decisions/0024-planner-process.md.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NoReturn

from fsw.autopilot.ports import Clock, PlanningCycle
from fsw.autopilot.signals import Plan, PlanFailure, PlanRequest, PlanTimings, SolverStatus
from fsw.runtime.process import PLANNER_PRIORITY, claim_real_time, die_with_parent

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

        Raises:
            PeerGone: The other process has ended.
        """
        try:
            self._socket.send(pickle.dumps(value, pickle.HIGHEST_PROTOCOL), socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError:
            raise PeerGone from None

    def receive(self, *, wait: bool) -> Any:
        """The next value; None if there is none and ``wait`` is False.

        Raises:
            PeerGone: The other process has ended, and nothing that it sent is left.
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
