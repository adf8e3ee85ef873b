"""What the process asks of the operating system before it flies."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
from types import FrameType
from typing import Final

TICK_PRIORITY: Final = 50
PLANNER_PRIORITY: Final = 40  # the tick goes first, ordinary programs come after both
_SWITCH_INTERVAL_S: Final = 100e-6
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


class StopRequest:
    """Becomes true on SIGINT or SIGTERM, so that the loop can end between two ticks."""

    def __init__(self) -> None:
        self.requested = False

    def listen(self) -> None:
        """Take over both signals; until then SIGINT raises KeyboardInterrupt."""
        signal.signal(signal.SIGINT, self._request)
        signal.signal(signal.SIGTERM, self._request)

    def _request(self, number: int, frame: FrameType | None) -> None:
        self.requested = True


def settle_memory() -> None:
    """Take everything built so far out of the garbage collector's sight, and stop it.

    The loop makes no reference cycles, so counting references frees all it allocates; a
    collection over numba's and SciPy's objects would cost tens of milliseconds in a tick.
    """
    gc.collect()
    gc.freeze()
    gc.disable()


def claim_real_time(priority: int) -> bool:
    """Ask for real-time scheduling of the calling thread; False if that is not permitted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return False
    return True


def share_interpreter_fairly() -> None:
    """Let a due tick wait for the planner's Python no longer than this, instead of 5 ms."""
    sys.setswitchinterval(_SWITCH_INTERVAL_S)


def release_real_time() -> None:
    """Give ordinary scheduling back, for the work after the flight."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
