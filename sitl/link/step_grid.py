"""When the steps of a run in real time end: an absolute grid, which a pause moves."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

MAX_BEHIND_S: Final = 0.05  # is caught up with; the vehicle takes no part in steps that hurry


class StepGrid:
    """A late step shortens the next one and shifts nothing, up to ``MAX_BEHIND_S``.

    Further behind, the process was suspended, and simulated time is paused with it:
    hundreds of steps in a row would fly an uncontrolled vehicle into a wall.
    """

    def __init__(
        self,
        period_s: float,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Step 0 begins now, and each takes ``period_s``; ``sleep`` sleeps for seconds."""
        self._period_s = period_s
        self._clock = clock
        self._sleep = sleep
        self._start_s = clock()

    def begin(self, start_s: float) -> None:
        """Step 0 begins at this time instead."""
        self._start_s = start_s

    def wait(self, number: int) -> float:
        """Sleep until a step is over; returns by how much the grid was moved for a pause [s]."""
        due_s = self._start_s + (number + 1) * self._period_s
        remaining_s = due_s - self._clock()
        if remaining_s > 0.0:
            self._sleep(remaining_s)
        behind_s = self._clock() - due_s
        if behind_s <= MAX_BEHIND_S:
            return 0.0
        # Whole steps: the vehicle has laid its own grid behind the phase of this one.
        moved_s = behind_s // self._period_s * self._period_s
        self._start_s += moved_s
        return moved_s
