"""A clock that only moves when the loop sleeps or works, and a simulator on that clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from fsw.autopilot.signals import SensorFrame

PERIOD_US = 2_000
FIRST_US = 1_000_000


def frame(t_us: int, z: float = -2.0) -> SensorFrame:
    """A vehicle that hovers."""
    return SensorFrame(
        t_us, (0.0, 0.0, z), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0, 0.0, -9.81),
        (-0.7227, 1.4454), (0.0, 0.0),
    )  # fmt: skip


@dataclass
class VirtualTime:
    """The only clock of a test [us]."""

    now_us: int = 50_000_000
    late_us: Callable[[int], int] = lambda due_us: 0  # how late a sleeper wakes, by when it is due

    def clock(self) -> int:
        return self.now_us

    def sleep(self, seconds: float) -> None:
        due_us = self.now_us + round(1e6 * seconds)
        self.now_us = due_us + self.late_us(due_us)

    def work(self, duration_us: int) -> None:
        self.now_us += duration_us


def on_time(step: int) -> int:
    return 0


@dataclass
class VirtualSensors:
    """Frame k is sent at k periods of the wall clock, and arrives when ``delay_us`` says.

    None is a lost frame.
    """

    time: VirtualTime
    delay_us: Callable[[int], int | None] = on_time
    period_us: float = PERIOD_US  # of the wall clock: the sensors' own may be fast or slow
    begun_us: float = 0.0
    shutdown: bool = False
    _taken: int = field(default=0, init=False)  # frames up to this one have been read

    def __post_init__(self) -> None:
        self.begun_us = float(self.time.now_us)

    def arrival_us(self, step: int) -> float | None:
        delay = self.delay_us(step)
        return None if delay is None else self.begun_us + step * self.period_us + delay

    def wait_for_step(self) -> SensorFrame | None:
        until_us = self.time.now_us + 200_000
        step = self._next(until_us)
        if step is None:
            self.time.now_us = until_us
            return None
        arrival = self.arrival_us(step)
        assert arrival is not None
        self.time.now_us = max(self.time.now_us, round(arrival))
        self._taken = step
        return frame(FIRST_US + step * PERIOD_US)

    def newest(self) -> SensorFrame | None:
        newest = None
        while (step := self._next(self.time.now_us)) is not None:
            self._taken = newest = step
        return None if newest is None else frame(FIRST_US + newest * PERIOD_US)

    def wait(self, seconds: float) -> bool:
        until_us = self.time.now_us + round(1e6 * seconds)
        step = self._next(until_us)
        if step is None:
            self.time.now_us = until_us
            return False
        arrival = self.arrival_us(step)
        assert arrival is not None
        self.time.now_us = max(self.time.now_us, round(arrival))
        return True

    def _next(self, until_us: float) -> int | None:
        """The first frame not yet read that arrives by then."""
        last = self._taken + 2 + int((until_us - self.begun_us) // self.period_us)
        while self.delay_us(self._taken + 1) is None and self._taken + 1 < last:
            self._taken += 1  # lost for good
        for step in range(self._taken + 1, min(last, self._taken + 50)):
            arrival = self.arrival_us(step)
            if arrival is not None and arrival <= until_us:
                return step
        return None
