r"""The planner's own processes: a nursery that never plans, and the worker it has forked.

    tick process  ==request, answer==  worker
          \-- forks -- nursery -- forks --/

The nursery was forked when everything had been compiled and warmed up, and does nothing but wait
for its worker to end. A worker that dies is replaced from there in milliseconds, without the tick
process having to fork, and reads on from the same link. All end with the process they serve.
"""

from __future__ import annotations

import os
import signal
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NoReturn

from fsw.ports import Clock, PlanningCycle
from fsw.runtime.process import die_with_parent
from fsw.runtime.process_link import PeerGone, ProcessLink, process_link
from fsw.runtime.realtime import PLANNER_PRIORITY, claim_real_time
from fsw.signals import Plan, PlanFailure, PlanRequest, PlanTimings, SolverStatus

_RECOVERY_S: Final = 0.02  # before the next worker, which might die at once as well


@dataclass(frozen=True, slots=True)
class Answer:
    """A finished cycle; times on the clock that all processes share."""

    t_apply_us: int
    result: Plan | PlanFailure
    begun_us: int
    duration_us: int


@dataclass(frozen=True, slots=True)
class Born:
    """A worker is there."""

    process: int


@dataclass(frozen=True, slots=True)
class Died:
    """A worker has ended without having been told to."""

    exit_code: int  # negative: the signal


def start(planner: PlanningCycle, clock: Clock) -> tuple[int, ProcessLink]:
    """Fork the nursery; returns its process number and our end of the link."""
    ours, theirs = process_link()
    parent = os.getpid()
    nursery = os.fork()
    if nursery == 0:
        _live(lambda: _nurse(planner, clock, theirs), parent, theirs)
    theirs.close()
    return nursery, ours


def answer(planner: PlanningCycle, clock: Clock, request: PlanRequest) -> Answer:
    """Plan, whatever comes of it."""
    begin = clock()
    try:
        result = planner.plan(request)
    except Exception as error:
        # To the tick a planner that raises is one more failed cycle, and the running plan goes on.
        reason = f"planner raised {type(error).__name__}: {error}"
        nothing = PlanTimings(0.0, 0.0, 0.0)
        result = PlanFailure(request.plan_id, SolverStatus.NUMERICAL_ERROR, reason, nothing)
    return Answer(request.t_apply_us, result, begin, clock() - begin)


def _nurse(planner: PlanningCycle, clock: Clock, link: ProcessLink) -> None:
    """Keep one worker alive until the one that is served has gone."""
    claim_real_time(PLANNER_PRIORITY)
    while True:
        nursery = os.getpid()
        worker = os.fork()
        if worker == 0:
            _live(lambda: _work(planner, clock, link), nursery, link)
        _, status = os.waitpid(worker, 0)
        exit_code = os.waitstatus_to_exitcode(status)
        if exit_code == 0:
            return
        link.send(Died(exit_code))
        time.sleep(_RECOVERY_S)


def _work(planner: PlanningCycle, clock: Clock, link: ProcessLink) -> None:
    """Answer requests, always the newest, until the one that asks has gone."""
    claim_real_time(PLANNER_PRIORITY)
    link.send(Born(os.getpid()))
    while True:
        request: PlanRequest = link.receive()
        while (newer := link.receive_waiting()) is not None:
            request = newer
        link.send(answer(planner, clock, request))


def _live(life: Callable[[], None], parent: int, link: ProcessLink) -> NoReturn:
    """The whole life of a forked process: nothing of its parent's is unwound or written twice."""
    code = 1
    try:
        die_with_parent(parent)
        # The terminal's interrupt goes to all processes; the end of these is the end of the link.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        _keep_only(link.fileno())
        life()
        code = 0
    except PeerGone:
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _keep_only(number: int) -> None:
    """Close what was inherited: ports and logs are the parent's alone."""
    nothing = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1):
        os.dup2(nothing, standard)
    os.closerange(3, number)
    os.closerange(number + 1, os.sysconf("SC_OPEN_MAX"))
