"""What releases a tick: in lockstep the simulator's step, in real time the vehicle's own grid.

In real time the vehicle wakes on an absolute grid of its own, which it has laid a little behind the
arrival of the sensor frames, and takes the newest frame there is. A frame that is late or lost does
not stop the inner loop: the tick gets the last readings and is told how old they are. After
``MOST_STALE`` such ticks time stands still: nothing is commanded any more, and whoever drives the
rotors stops them after 0.1 s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final, Protocol

from fsw.frozen import dataclass
from fsw.ports import Clock
from fsw.runtime.grid import Grid
from fsw.runtime.missed import MissedReleases
from fsw.signals import SensorFrame

MOST_STALE: Final = 5  # ticks: 10 ms, as long as an estimate may be missing
LEAD_US: Final = 600  # frames arrive so much before their tick, and may be so much late
_SETTLING: Final = 25  # frames until the grid is laid
_LISTEN_TICKS: Final = 25  # between two looks at when a frame arrives
# Before the release: listening begins well before a frame is due, and where the grid is further off
# than that, it moves by the most anyway. Who listens for a frame does not hear the ground.
_LISTEN_US: Final = LEAD_US + 300
_MOST_SHIFT_US: Final = 25.0  # a look; 500 us/s is more than clocks differ
_GAIN: Final = 0.25
_REPEATED: Final = 3  # frames in a row behind or ahead of their release, until it is another's


class SensorLink(Protocol):
    """Where sensor frames come from."""

    @property
    def shutdown(self) -> bool:
        """Whether there will be no more."""
        ...

    def wait_for_step(self) -> SensorFrame | None:
        """Wait for the next frame, with some patience."""
        ...

    def newest(self) -> SensorFrame | None:
        """The newest of the frames that are there."""
        ...

    def wait(self, seconds: float) -> bool:
        """Wait until something is there; False when the time is over."""
        ...


@dataclass(frozen=True, slots=True)
class Release:
    """A tick may run."""

    sensors: SensorFrame  # stamped with the instant of the tick
    stale_us: int  # how much older its readings are
    due_us: int  # wall time at which it should have begun
    begun_us: int  # wall time


class Releases(Protocol):
    """One release after the other."""

    stale: int  # ticks without a frame of their own

    @property
    def skipped(self) -> int:
        """Releases that were never taken."""
        ...

    def next(self) -> Release | None:
        """Wait for the next release; None when there was nothing to tick on."""
        ...


class StepReleases:
    """Lockstep: every step of the simulator releases a tick, whenever it comes."""

    def __init__(self, sim: SensorLink, clock: Clock) -> None:
        self.stale = 0
        self._sim = sim
        self._clock = clock

    @property
    def skipped(self) -> int:
        """See :class:`Releases`: every step is taken."""
        return 0

    def next(self) -> Release | None:
        """See :class:`Releases`."""
        sensors = self._sim.wait_for_step()
        if sensors is None:
            return None
        now_us = self._clock()
        return Release(sensors, 0, now_us, now_us)


class GridReleases:
    """Real time: an absolute grid, phased behind the arrival of the sensor frames."""

    def __init__(
        self,
        sim: SensorLink,
        clock: Clock,
        sleep: Callable[[float], None],
        first: SensorFrame,
        period_us: int,
        missed: MissedReleases,
    ) -> None:
        """Follow the first frame, which has been ticked on.

        Args:
            sim: Where the frames come from.
            clock: Monotonic wall time.
            sleep: Sleeps for seconds, on the same clock.
            first: The frame whose time the vehicle's time begins with.
            period_us: Of the inner loop.
            missed: Where to note the releases that are skipped.
        """
        self.stale = 0
        self._sim = sim
        self._clock = clock
        self._sleep = sleep
        self._period_us = period_us
        self._missed = missed
        self._grid: Grid | None = None
        self._offsets: list[int] = []  # arrival minus stamp, while the grid is not laid
        self._readings = first
        self._t_us = first.t_us  # of the last tick
        self._grid_us = first.t_us  # of the frame that belongs to the last release
        self._repeated = 0  # frames in a row that had been anticipated
        self._ahead = 0  # frames in a row that were ahead of their release
        self._left_out = 0

    @property
    def skipped(self) -> int:
        """Releases that were never taken."""
        return self._left_out + (0 if self._grid is None else self._grid.skipped)

    def next(self) -> Release | None:
        """See :class:`Releases`."""
        if self._grid is None:
            return self._settle()
        steps = self._grid.advance(self._clock())
        if steps > 1:
            due_us = self._grid.due_us
            self._missed.add(due_us - (steps - 1) * self._period_us, due_us - self._period_us)
        self._wait(self._grid, self._grid.due_us)
        return self._release(self._grid, steps)

    def _settle(self) -> Release | None:
        """Tick on arrival, and lay the grid by the promptest of the first frames."""
        sensors, now_us = self._sim.wait_for_step(), self._clock()
        if sensors is None:
            return None
        self._readings, self._t_us, self._grid_us = sensors, sensors.t_us, sensors.t_us
        self._offsets.append(now_us - sensors.t_us)
        if len(self._offsets) >= _SETTLING:
            start_us = min(self._offsets) + sensors.t_us + LEAD_US
            self._grid = Grid(start_us + self._period_us, self._period_us)
        return Release(sensors, 0, min(self._offsets) + sensors.t_us, now_us)

    def _wait(self, grid: Grid, due_us: int) -> None:
        """Sleep until the release; now and then listen for the frame, and follow its clock."""
        if grid.index % _LISTEN_TICKS == 0 and not self._sim.wait(0.0):
            self._sleep_until(due_us - _LISTEN_US)
            arrived = self._sim.wait(1e-6 * max(due_us - self._clock(), 0))
            early_us = due_us - self._clock() if arrived else 0
            shift_us = _GAIN * (LEAD_US - early_us)
            grid.steer(min(max(shift_us, -_MOST_SHIFT_US), _MOST_SHIFT_US))
        self._sleep_until(due_us)

    def _sleep_until(self, until_us: int) -> None:
        remaining_us = until_us - self._clock()
        if remaining_us > 0:
            self._sleep(1e-6 * remaining_us)

    def _release(self, grid: Grid, steps: int) -> Release | None:
        due_us, begun_us = grid.due_us, self._clock()
        newest = self._sim.newest()
        if newest is None and self._sim.shutdown:
            return None  # not missed: it is over
        self._grid_us += steps * self._period_us
        if newest is not None:
            self._readings = newest
            if newest.t_us > self._t_us:
                self._match(newest.t_us)
                self._t_us, self._repeated = newest.t_us, 0
                return Release(newest, 0, due_us, begun_us)
            # Time has run ahead of the frames: wait for them once, or they stay behind.
            self._repeated += 1
            if self._repeated >= _REPEATED:
                self._repeated, self._grid_us = 0, newest.t_us
        stale_us = self._grid_us - self._readings.t_us
        if self._grid_us <= self._t_us or stale_us > MOST_STALE * self._period_us:
            self._left_out += 1
            self._missed.add(due_us)
            return None
        self._t_us = self._grid_us
        self.stale += 1
        return Release(replace(self._readings, t_us=self._t_us), stale_us, due_us, begun_us)

    def _match(self, t_us: int) -> None:
        """Note which frame came to which release: at once behind, for good only if it repeats."""
        self._ahead = self._ahead + 1 if t_us > self._grid_us else 0
        if t_us < self._grid_us or self._ahead >= _REPEATED:
            self._grid_us, self._ahead = t_us, 0
