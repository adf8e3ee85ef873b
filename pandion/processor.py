"""Which processors the two processes of a flight in lockstep should run on.

In lockstep the two take turns. On two processors each keeps its caches, and the one that waits
polls for the datagram instead of sleeping (``messages/busy_poll.py``). On one, the kernel switches
from one to the other, which is slower (docs/decisions/0017). But polling helps only while the
other one runs: on a busy machine, both on the quietest processor disturb least.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Final, NamedTuple

_GLANCE_S: Final = 0.05
_IDLE: Final = 0.7  # share of a processor's time that must be unused


class Places(NamedTuple):
    """A processor for each process; None: the system's choice."""

    sitl: int | None = None
    fsw: int | None = None


ANYWHERE: Final = Places()


def lockstep_places() -> Places:
    """Two idle processors, else the quietest one for both, else the system's choice."""
    if sys.platform != "linux":
        return ANYWHERE
    allowed = os.sched_getaffinity(0)
    try:
        before, begin_s = _idle_s(), time.monotonic()
        time.sleep(_GLANCE_S)
        after, passed_s = _idle_s(), time.monotonic() - begin_s
    except (OSError, ValueError, IndexError):
        return ANYWHERE
    idle = {cpu: after[cpu] - before[cpu] for cpu in allowed if cpu in before and cpu in after}
    # The process's number breaks ties, so that flights started together spread out.
    quietest = sorted(idle, key=lambda cpu: (-idle[cpu], (cpu + os.getpid()) % len(allowed)))
    if not quietest:
        return ANYWHERE
    if len(quietest) > 1 and idle[quietest[1]] > _IDLE * passed_s:
        return Places(quietest[1], quietest[0])
    return Places(quietest[0], quietest[0])


def _idle_s() -> dict[int, float]:
    """Idle time of each processor so far [s]."""
    ticks_per_s = os.sysconf("SC_CLK_TCK")
    idle = {}
    for line in Path("/proc/stat").read_text(encoding="ascii").splitlines():
        name, *counts = line.split()
        if name.startswith("cpu") and name != "cpu":
            idle[int(name[3:])] = int(counts[3]) / ticks_per_s
    return idle
