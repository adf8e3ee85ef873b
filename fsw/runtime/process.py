"""What the process asks of the operating system before it flies."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

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
    """Take everything built so far out of the garbage collector's sight, and stop it.

    The loop makes no reference cycles, so counting references frees all it allocates; a
    collection over numba's and SciPy's objects would cost tens of milliseconds in a tick.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    _give_memory_back()
    _fill_free_lists()


def _fill_free_lists() -> None:
    """Grow now what CPython would grow over minutes: it keeps 2000 freed tuples of every size."""
    for size in range(1, 20):
        kept = [tuple([None] * size) for _ in range(2000)]
        del kept


def _give_memory_back() -> None:
    """Return what building needed and flying does not: freed memory, and the compiler's pages.

    Everything is compiled by now. LLVM's code can be dropped from memory as long as it is not
    locked; a page that is wanted after all is read from its file again.
    """
    if sys.platform != "linux":
        return
    libc = ctypes.CDLL(None)
    libc.malloc_trim(0)
    for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
        addresses, rights, *_, path = line.split(maxsplit=5)
        if "llvmlite" in path and rights == "r-xp":  # code: it alone is as it is in the file
            first, last = (int(address, 16) for address in addresses.split("-"))
            libc.madvise(ctypes.c_void_p(first), ctypes.c_size_t(last - first), _MADV_DONTNEED)


def in_a_child(work: Callable[[], object]) -> None:
    """Do something for what it leaves on disk, in a child that takes its memory away with it.

    Call it while there is one thread. What fails there fails silently: whoever needs the result
    finds it missing and does the work itself.
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
    """Tie the life of a process that was just forked to its parent's (Linux only)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)
