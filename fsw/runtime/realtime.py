"""What a process asks of Linux to be on time, and what it was refused."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from typing import Final

TICK_PRIORITY: Final = 50
PLANNER_PRIORITY: Final = 40  # the tick goes first, ordinary programs come after both
_SWITCH_INTERVAL_S: Final = 100e-6
# Now and later, each page from its first use: all of it at once would copy what forks share.
_MCL_CURRENT_FUTURE_ONFAULT: Final = 1 | 2 | 4
_PR_SET_TIMERSLACK: Final = 29


def claim_real_time(priority: int) -> tuple[str, ...]:
    """Ask for everything for the calling process; returns what was refused, by name."""
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
    return tuple(refused)


def release_real_time() -> None:
    """Give ordinary scheduling back, for the work after the flight."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    ctypes.CDLL(None).munlockall()


def share_interpreter_fairly() -> None:
    """Let a due tick wait for another thread's Python no longer than this, instead of 5 ms."""
    sys.setswitchinterval(_SWITCH_INTERVAL_S)


def scheduler() -> str:
    """The scheduling class of the calling process, for reports."""
    policy = os.sched_getscheduler(0)
    if policy == os.SCHED_FIFO:
        return f"SCHED_FIFO {os.sched_getparam(0).sched_priority}"
    return {os.SCHED_OTHER: "SCHED_OTHER", os.SCHED_RR: "SCHED_RR"}.get(policy, str(policy))
