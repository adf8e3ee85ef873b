"""Loops that only sleep, beside a flight: where they are late as well, the machine stood still.

They wake about as often as the tick, at a higher priority than anything of the flight, so nothing
of ours makes them late. One a processor, as ``python -m benchmarks.bare_loop PROCESSOR``.
"""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import time
from typing import Final

from benchmarks.stops import Stops, Stretch
from command_line.process import StopRequest
from fsw.runtime.clock import now_us
from fsw.runtime.process import claim_real_time
from fsw.runtime.rate_groups import INNER
from fsw.runtime.releases import ReleaseSchedule

_PRIORITY: Final = 60  # SCHED_FIFO; the tick has 50
# Waking costs a virtual machine 30 us, and at twice the rate the tick's median grew by process. Not
# the tick's period either: a loop that is due with the tick would hold up every tick of a flight.
_PERIOD_US: Final = 1_930
_STOPPED_US: Final = 500  # an idle processor wakes a sleeper within a tenth of that
_MOST: Final = 4  # processors: a stop of the machine is seen on any


class BareLoops:
    """Sleeping loops for as long as a block lasts."""

    def __init__(self) -> None:
        self.stops: Stops | None = None  # at the end of the block; None: priority was refused
        self._loops: list[subprocess.Popen[str]] = []

    def __enter__(self) -> BareLoops:
        for processor in sorted(os.sched_getaffinity(0))[:_MOST]:
            command = [sys.executable, "-m", "benchmarks.bare_loop", str(processor)]
            self._loops.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        return self

    def __exit__(self, *_: object) -> None:
        for loop in self._loops:
            loop.terminate()
        reported = [loop.communicate()[0] for loop in self._loops]
        if reported and all(reported):
            late = [[(due, woken) for due, woken in json.loads(text)] for text in reported]
            self.stops = Stops(late, INNER.period_us)


def main(processor: int) -> None:
    """Sleep from release to release until asked to end; print from when to when it was late."""
    stop = StopRequest()
    stop.listen()
    os.sched_setaffinity(0, {processor})
    claim_real_time(_PRIORITY)
    if os.sched_getscheduler(0) != os.SCHED_FIFO:
        return  # its lateness would say nothing about the machine
    gc.disable()
    late: list[Stretch] = []
    schedule = ReleaseSchedule(now_us() + _PERIOD_US, _PERIOD_US)
    while not stop.requested:
        schedule.advance(now_us())
        time.sleep(1e-6 * max(schedule.due_us - now_us(), 0))
        woken_us = now_us()
        if woken_us - schedule.due_us > _STOPPED_US:
            late.append((schedule.due_us, woken_us))
    print(json.dumps(late))


if __name__ == "__main__":
    main(int(sys.argv[1]))
