"""The process itself: threads of libraries, signals, memory, and children."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
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
