"""Which processor two halves in lockstep should share.

In lockstep only one half runs at a time. On one processor the kernel switches from one to the
other directly; on two, every datagram has to wake an idle processor, which costs more than the
step itself (7.4 against 10.1 times real time on an otherwise idle virtual machine).
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Final

_GLANCE_S: Final = 0.05


def quietest() -> int | None:
    """The processor this process may use that was idle most just now; None where unknown."""
    if sys.platform != "linux":
        return None
    allowed = os.sched_getaffinity(0)
    try:
        before = _idle_ticks()
        time.sleep(_GLANCE_S)
        after = _idle_ticks()
    except (OSError, ValueError, IndexError):
        return None
    known = [cpu for cpu in allowed if cpu in before and cpu in after]
    # The process's number breaks ties, so that flights started together spread out.
    return max(
        known,
        key=lambda cpu: (after[cpu] - before[cpu], (cpu + os.getpid()) % len(allowed)),
        default=None,
    )


def _idle_ticks() -> dict[int, int]:
    """Idle time of each processor so far, in the kernel's ticks."""
    idle = {}
    for line in Path("/proc/stat").read_text(encoding="ascii").splitlines():
        name, *counts = line.split()
        if name.startswith("cpu") and name != "cpu":
            idle[int(name[3:])] = int(counts[3])
    return idle
