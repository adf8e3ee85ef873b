"""Real-time scheduling and locked memory, as far as Linux grants them to the process."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import threading
from pathlib import Path
from typing import Final

TICK_PRIORITY: Final = 50
PLANNER_PRIORITY: Final = 40  # the tick goes first, ordinary programs come after both
_SWITCH_INTERVAL_S: Final = 100e-6  # a due tick waits for another thread's Python, not 5 ms
# Now and later, each page from its first use: all of it at once would copy what forks share.
_MCL_CURRENT_FUTURE_ONFAULT: Final = 1 | 2 | 4
_PR_SET_TIMERSLACK: Final = 29


def claim_real_time(priority: int) -> tuple[str, ...]:
    """Request both for the calling process; returns the names of what was refused.

    Call :func:`rank_threads` once all threads have started.
    """
    refused = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        refused.append("real-time scheduling")
    libc = ctypes.CDLL(None)
    if libc.mlockall(_MCL_CURRENT_FUTURE_ONFAULT) != 0:
        refused.append("locked memory")
    # Only matters where real-time scheduling was refused: it has no slack.
    libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    return tuple(refused)


def rank_threads() -> None:
    """Make the other threads of a real-time process real-time as well, right behind the caller.

    A thread that loses its processor to an ordinary program while it holds the interpreter stops
    the tick; 0.4 s were measured.
    """
    if os.sched_getscheduler(0) != os.SCHED_FIFO:
        return
    behind = os.sched_param(os.sched_getparam(0).sched_priority - 1)
    for thread in _other_threads():
        with contextlib.suppress(OSError):
            os.sched_setscheduler(thread, os.SCHED_FIFO, behind)


def release_real_time() -> None:
    """Give ordinary scheduling back, for the work after the flight."""
    for thread in (0, *_other_threads()):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))
    ctypes.CDLL(None).munlockall()


def _other_threads() -> list[int]:
    """Threads of this process except the caller's; none where there is no ``/proc``."""
    try:
        threads = [int(thread.name) for thread in Path("/proc/self/task").iterdir()]
    except OSError:
        return []
    return [thread for thread in threads if thread != threading.get_native_id()]


def scheduler() -> str:
    """The scheduling class of the calling process, for reports."""
    policy = os.sched_getscheduler(0)
    if policy == os.SCHED_FIFO:
        return f"SCHED_FIFO {os.sched_getparam(0).sched_priority}"
    return {os.SCHED_OTHER: "SCHED_OTHER", os.SCHED_RR: "SCHED_RR"}.get(policy, str(policy))
