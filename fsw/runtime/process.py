"""The process itself: threads of libraries, signals, memory, children, and real time.

Real-time scheduling and locked memory are had as far as Linux grants them to the process.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

TICK_PRIORITY: Final = 50
PLANNER_PRIORITY: Final = 40  # the tick goes first, ordinary programs come after both
_SWITCH_INTERVAL_S: Final = 100e-6  # a due tick waits for another thread's Python, not 5 ms
# Now and later, each page from its first use: all of it at once would copy what forks share.
_MCL_CURRENT_FUTURE_ONFAULT: Final = 1 | 2 | 4
_PR_SET_TIMERSLACK: Final = 29
_PR_SET_PDEATHSIG: Final = 1
_MADV_DONTNEED: Final = 4
_THREAD_VARIABLES: Final = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "RAYON_NUM_THREADS",
)


def pin_numerics_to_one_thread() -> None:
    """Keep BLAS, numba and Clarabel on one core; call it before numpy is imported.

    Two BLAS threads make these small problems slower and steal the core of the simulator.
    """
    for name in _THREAD_VARIABLES:
        os.environ[name] = "1"


def settle_memory() -> None:
    """Stop the garbage collector, and return memory that only building needed.

    The loop makes no reference cycles, so counting references frees all it allocates; a
    collection over numba's and SciPy's objects would cost tens of milliseconds in a tick.
    """
    from fsw.compiled import forget_bitcode  # numba, which is imported with threads pinned

    forget_bitcode()
    gc.collect()
    gc.freeze()
    gc.disable()
    _give_memory_back()


def _give_memory_back() -> None:
    """Return freed memory, and the code of LLVM: 58 MB, which nothing runs once all is compiled.

    Its pages can be dropped as long as they are not locked; one that is used after all is read
    from its file again.
    """
    libc = ctypes.CDLL(None)
    libc.malloc_trim(0)
    for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
        addresses, rights, *_, path = line.split(maxsplit=5)
        if "llvmlite" in path and rights == "r-xp":  # code: unlike data, as it is in the file
            first, last = (int(address, 16) for address in addresses.split("-"))
            libc.madvise(ctypes.c_void_p(first), ctypes.c_size_t(last - first), _MADV_DONTNEED)


def in_a_child(work: Callable[[], object]) -> None:
    """Do work that leaves its result on disk, in a child, so that its memory is returned.

    Call it while there is one thread. Errors are silent: the caller finds the result missing and
    does the work itself.
    """
    parent = os.getpid()
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        return
    try:
        die_with_parent(parent)
        work()
    finally:
        os._exit(0)  # neither traceback nor buffered output of the parent's


def die_with_parent(parent: int) -> None:
    """In a process that was just forked: let the kernel kill it when its ``parent`` ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)


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
