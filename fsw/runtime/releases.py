"""What releases a tick: in lockstep the simulator's step, in real time the vehicle's own schedule.

In real time the vehicle wakes on an absolute schedule of its own, a little behind the arrival of
the sensor frames, and takes the newest frame. A late or lost frame does not stop the inner loop:
the tick gets the last readings with their age. After ``MAX_STALE_TICKS`` such ticks no tick runs
until a frame arrives; without commands the motor controllers level the vehicle by themselves.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from fsw.autopilot.periods import TICK_US
from fsw.autopilot.ports import Clock
from fsw.autopilot.signals import SensorFrame
from fsw.frozen import dataclass
from fsw.link.vehicle_link import VehicleLink

MAX_STALE_TICKS: Final = 10_000 // TICK_US  # as long as an estimate may be missing
LEAD_US: Final = 600  # frames arrive so much before their tick, and may be so much late
_SETTLING_FRAMES: Final = 25  # until the schedule begins
_PROBE_TICKS: Final = 25  # between two measurements of when a frame arrives
# A measurement begins well before a frame is due. If the schedule is off by more, it moves by the
# maximum anyway. The ground links are not read meanwhile.
_PROBE_US: Final = LEAD_US + 300  # before the release
_MAX_SHIFT_US: Final = 25.0  # a measurement; 500 us/s is more than clocks differ
_GAIN: Final = 0.25
_REMATCH_FRAMES: Final = 3  # in a row behind or ahead of their release, until it is another's
WARNING_INTERVAL_US: Final = 10_000_000  # vehicle time
# New ones in an interval, of 5000 ticks and 100 plans. Fewer do not concern an operator; they are
# counted in LOOP_TIMING, MPC_STATUS, the log and the result all the same.
WARNING_LIMITS: Final = {"late": 50, "skipped": 50, "without sensors": 50, "plans late": 5}
_MAX_INTERVALS: Final = 2_000  # bounds memory
_JOINED_US: Final = 3_000  # one and a half periods of the inner loop


@dataclasses.dataclass(slots=True)
class ReleaseSchedule:
    """Releases at ``start + k * period``. Missed ones are skipped; the others do not move."""

    start_us: float  # of release 0 [us, monotonic]
    period_us: int
    index: int = -1  # of the last release
    skipped: int = 0  # releases that were never taken

    def advance(self, now_us: int) -> int:
        """Go to the next release whose period is not over at ``now_us`` [us]; returns the steps.

        A release whose period is not over yet is still taken, late; one whose period is over is
        skipped. If the clock jumps back, the next release is waited for, and none is repeated.
        """
        current = int((now_us - self.start_us) // self.period_us)
        steps = max(current - self.index, 1)
        self.index += steps
        self.skipped += steps - 1
        return steps

    @property
    def due_us(self) -> int:
        """When the current release is or was due [us, monotonic]."""
        return round(self.start_us + self.index * self.period_us)


class DeadlineMonitor:
    """Collects missed releases, and warns when they matter to the operator."""

    def __init__(self) -> None:
        # Due times of the first and last release of each row [us, monotonic]: the benchmarks hold
        # them against the times in which the machine did not run.
        self.missed: list[tuple[int, int]] = []
        self._before: Counter[str] = Counter()
        self._since_us: int | None = None  # when the counts were ``_before``
        self._warned_us: int | None = None

    def add(self, first_us: int, last_us: int | None = None) -> None:
        """Add a release due at ``first_us`` [us], or all from there to ``last_us`` [us]."""
        last_us = first_us if last_us is None else last_us
        if self.missed and first_us - self.missed[-1][1] < _JOINED_US:
            self.missed[-1] = (self.missed[-1][0], last_us)
        elif len(self.missed) < _MAX_INTERVALS:
            self.missed.append((first_us, last_us))

    def warning(
        self, t_us: int, *, late: int = 0, skipped: int = 0, stale: int = 0, plans_late: int = 0
    ) -> str | None:
        """The text to send at ``t_us`` [us, vehicle time], if any: what was missed since the last.

        Counts are since start: ticks that ended after the next release, releases without a tick,
        ticks without a sensor frame of their own, plans that missed their deadline.
        """
        counts = Counter(dict(zip(WARNING_LIMITS, (late, skipped, stale, plans_late), strict=True)))
        if self._since_us is None:
            self._since_us = t_us
        added = counts - self._before
        matters = any(count >= WARNING_LIMITS[what] for what, count in added.items())
        if matters and (self._warned_us is None or t_us - self._warned_us >= WARNING_INTERVAL_US):
            self._before, self._since_us, self._warned_us = counts, t_us, t_us
            return "ticks: " + ", ".join(f"{count} {what}" for what, count in added.items())
        if not matters and t_us - self._since_us >= WARNING_INTERVAL_US:
            self._before, self._since_us = counts, t_us
        return None


@dataclass(frozen=True, slots=True)
class Release:
    """What a tick runs on."""

    sensors: SensorFrame  # stamped with the instant of the tick
    stale_us: int  # how much older its readings are
    due_us: int  # when it should have begun, monotonic
    begun_us: int  # monotonic


@dataclasses.dataclass
class StepReleases:
    """Lockstep: every step of the simulator releases a tick, whenever it comes."""

    _vehicle: VehicleLink
    _clock: Clock
    stale = skipped = 0  # every step is taken

    def next(self) -> Release | None:
        """Wait for the next step; None if none came."""
        sensors = self._vehicle.wait_for_step()
        if sensors is None:
            return None
        now_us = self._clock()
        return Release(sensors, 0, now_us, now_us)


@dataclasses.dataclass
class ScheduledReleases:
    """Real time: an absolute schedule, phased behind the arrival of the sensor frames.

    It follows the first frame, on which a tick has run: the vehicle's time begins with it.
    """

    _vehicle: VehicleLink
    _clock: Clock
    _sleep: Callable[[float], None]  # for seconds, on the same clock
    _readings: SensorFrame  # the newest, at first those of the first frame
    _period_us: int
    _deadlines: DeadlineMonitor  # takes the skipped releases
    stale: int = 0  # ticks without a frame of their own
    _schedule: ReleaseSchedule | None = None
    _offsets: list[int] = dataclasses.field(default_factory=list)  # arrival minus stamp, before it
    _repeated: int = 0  # frames in a row whose tick had run before they came
    _ahead: int = 0  # frames in a row that were ahead of their release
    _without_tick: int = 0  # releases taken, but with too old readings for a tick

    def __post_init__(self) -> None:
        self._t_us = self._readings.t_us  # of the last tick
        self._expected_us = self._t_us  # stamp of the frame that belongs to the last release

    @property
    def skipped(self) -> int:
        """Releases that were never taken."""
        return self._without_tick + (self._schedule.skipped if self._schedule else 0)

    def next(self) -> Release | None:
        """Wait for the next release; None if there is nothing to tick on."""
        schedule = self._schedule
        if schedule is None:
            return self._settle()
        steps = schedule.advance(self._clock())
        if steps > 1:
            due_us = schedule.due_us
            self._deadlines.add(due_us - (steps - 1) * self._period_us, due_us - self._period_us)
        self._wait(schedule, schedule.due_us)
        return self._release(schedule.due_us, steps)

    def _settle(self) -> Release | None:
        """Tick on arrival, and begin the schedule behind the promptest of the first frames."""
        sensors, now_us = self._vehicle.wait_for_step(), self._clock()
        if sensors is None:
            return None
        self._readings, self._t_us, self._expected_us = sensors, sensors.t_us, sensors.t_us
        self._offsets.append(now_us - sensors.t_us)
        if len(self._offsets) >= _SETTLING_FRAMES:
            start_us = min(self._offsets) + sensors.t_us + LEAD_US
            self._schedule = ReleaseSchedule(start_us + self._period_us, self._period_us)
        return Release(sensors, 0, min(self._offsets) + sensors.t_us, now_us)

    def _wait(self, schedule: ReleaseSchedule, due_us: int) -> None:
        """Sleep until the release; now and then measure when the frame comes, and follow it."""
        if schedule.index % _PROBE_TICKS == 0 and not self._vehicle.wait(0.0):
            self._sleep_until(due_us - _PROBE_US)
            arrived = self._vehicle.wait(1e-6 * max(due_us - self._clock(), 0))
            early_us = due_us - self._clock() if arrived else 0
            shift_us = _GAIN * (LEAD_US - early_us)
            # All coming releases move: the sensors' clock differs from ours.
            schedule.start_us += min(max(shift_us, -_MAX_SHIFT_US), _MAX_SHIFT_US)
        self._sleep_until(due_us)

    def _sleep_until(self, until_us: int) -> None:
        remaining_us = until_us - self._clock()
        if remaining_us > 0:
            self._sleep(1e-6 * remaining_us)

    def _release(self, due_us: int, steps: int) -> Release | None:
        begun_us = self._clock()
        newest = self._vehicle.newest()
        if newest is None and self._vehicle.shutdown:
            return None  # not missed: the run is over
        self._expected_us += steps * self._period_us
        if newest is not None:
            self._readings = newest
            if newest.t_us > self._t_us:
                self._match(newest.t_us)
                self._t_us, self._repeated = newest.t_us, 0
                return Release(newest, 0, due_us, begun_us)
            # Time has run ahead of the frames: wait for them once, or they stay behind.
            self._repeated += 1
            if self._repeated >= _REMATCH_FRAMES:
                self._repeated, self._expected_us = 0, newest.t_us
        stale_us = self._expected_us - self._readings.t_us
        if self._expected_us <= self._t_us or stale_us > MAX_STALE_TICKS * self._period_us:
            self._without_tick += 1
            self._deadlines.add(due_us)
            return None
        self._t_us = self._expected_us
        self.stale += 1
        return Release(replace(self._readings, t_us=self._t_us), stale_us, due_us, begun_us)

    def _match(self, t_us: int) -> None:
        """Note which frame came with which release: one behind at once, one ahead if it repeats."""
        self._ahead = self._ahead + 1 if t_us > self._expected_us else 0
        if t_us < self._expected_us or self._ahead >= _REMATCH_FRAMES:
            self._expected_us, self._ahead = t_us, 0
