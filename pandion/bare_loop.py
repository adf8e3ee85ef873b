"""Loops that only sleep, beside a flight: where they are late as well, the machine stood still.

They wake on a grid as the tick does, at a higher priority than anything of the flight, so nothing
of ours makes them late. One a processor, as ``python -m pandion.bare_loop PROCESSOR RELEASES``.
"""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import time
from types import TracebackType
from typing import Final

from fsw.runtime.clock import now_us
from fsw.runtime.grid import Grid
from fsw.runtime.process import StopRequest
from fsw.runtime.realtime import claim_real_time

_PRIORITY: Final = 60  # SCHED_FIFO; the tick has 50
_PERIOD_US: Final = 2_000
_LATE_US: Final = 1_500  # a tick that begins so late is not over by the next one
_MOST: Final = 4  # processors: a stop of the machine is seen on any


class BareLoops:
    """Sleeping loops for as long as a block lasts."""

    def __init__(self, seconds: float) -> None:
        """Ready to start.

        Args:
            seconds: What counts, at the end of the block: a flight begins with compiling.
        """
        self.late_share: float | None = None  # of their releases; None: priority was refused
        self._releases = round(1e6 * seconds / _PERIOD_US)
        self._loops: list[subprocess.Popen[str]] = []

    def __enter__(self) -> BareLoops:
        for processor in sorted(os.sched_getaffinity(0))[:_MOST]:
            numbers = (str(processor), str(self._releases))
            command = [sys.executable, "-m", "pandion.bare_loop", *numbers]
            self._loops.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for loop in self._loops:
            loop.terminate()
        said = [loop.communicate()[0] for loop in self._loops]
        counts = [json.loads(text) for text in said if text]
        if counts:
            releases = sum(count["releases"] for count in counts)
            self.late_share = sum(count["late"] for count in counts) / max(releases, 1)


def main(processor: int, releases: int) -> None:
    """Sleep from release to release until told to end; print how many of the last were late."""
    stop = StopRequest()
    stop.listen()
    os.sched_setaffinity(0, {processor})
    claim_real_time(_PRIORITY)
    if os.sched_getscheduler(0) != os.SCHED_FIFO:
        return  # its lateness would say nothing about the machine
    gc.disable()
    late: list[int] = []
    grid = Grid(now_us() + _PERIOD_US, _PERIOD_US)
    while not stop.requested:
        steps = grid.advance(now_us())
        late += range(grid.index - steps + 1, grid.index)  # skipped
        time.sleep(1e-6 * max(grid.due_us - now_us(), 0))
        if now_us() - grid.due_us > _LATE_US:
            late.append(grid.index)
    first = max(grid.index + 1 - releases, 0)
    counted = {"releases": grid.index + 1 - first, "late": sum(index >= first for index in late)}
    print(json.dumps(counted))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
