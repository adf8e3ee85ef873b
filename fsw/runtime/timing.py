"""How long ticks take and how late they start: bounded memory, cheap enough for every tick."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from typing import Final

from fsw.autopilot.ports import GroupTiming

_BINS_PER_E: Final = 50.0  # 2 % resolution
_BINS: Final = 900  # up to exp(18) us, about a minute
_KNOWN: Final = 4096  # us; whole durations below it have their bin in a table


def _bin(duration_us: float) -> int:
    return min(int(math.log(duration_us) * _BINS_PER_E), _BINS - 1) if duration_us > 1.0 else 0


_KNOWN_BINS: Final[dict[float, int]] = {
    duration_us: _bin(duration_us) for duration_us in range(_KNOWN)
}


def _bin_of(duration_us: float) -> int:
    known = _KNOWN_BINS.get(duration_us)
    return _bin(duration_us) if known is None else known


class Histogram:
    """Counts of durations in bins that grow by 2 %."""

    def __init__(self) -> None:
        self.count = 0
        self.total_us = 0.0
        self.max_us = 0.0
        self._bins = defaultdict[int, int](int)  # those that have counts: a few of all

    def add(self, duration_us: float) -> None:
        """Count one duration [us]; anything below 1 us is in the first bin."""
        self.count += 1
        self.total_us += duration_us
        if duration_us > self.max_us:
            self.max_us = duration_us
        self._bins[_bin_of(duration_us)] += 1

    def add_counted(self, durations_us: Mapping[float, int]) -> None:
        """Count durations [us] that each came so often."""
        self.count += sum(durations_us.values())
        self.total_us += sum([times * duration for duration, times in durations_us.items()])
        self.max_us = max(self.max_us, max(durations_us, default=0.0))
        for duration_us, times in durations_us.items():
            self._bins[_bin_of(duration_us)] += times

    def percentile_us(self, share: float) -> float:
        """Duration [us] that a ``share`` [1] of all counts does not exceed; 0 before the first."""
        wanted = share * self.count
        seen = 0
        for index, count in sorted(self._bins.items()):
            seen += count
            if seen >= wanted:
                # The upper edge of the last bin in use lies above the maximum.
                return min(math.exp((index + 1) / _BINS_PER_E), self.max_us)
        return 0.0

    def absorb(self, other: Histogram) -> None:
        """Add the counts of another histogram."""
        self.count += other.count
        self.total_us += other.total_us
        self.max_us = max(self.max_us, other.max_us)
        for index, count in other._bins.items():
            self._bins[index] += count


class GroupTimer:
    """Timing of one rate group: of the last interval and of the whole flight.

    The clock counts whole microseconds, and in one interval few are different. So each tick adds to
    the count of its own, a quarter of the time that a bin takes; they are sorted into bins when the
    interval is over.
    """

    def __init__(self, period_us: int) -> None:
        self.period_us = period_us
        self.ticks = 0  # counted since the start
        self.late = 0
        self.skipped = 0
        self.execution = Histogram()  # whole flight, up to the last interval
        self.lateness = Histogram()
        self._execution = defaultdict[float, int](int)  # this interval: how often each time
        self._lateness = defaultdict[float, int](int)

    def add(self, execution_us: float, lateness_us: float = 0.0) -> None:
        """Count one tick by its times [us]."""
        self.ticks += 1
        self._execution[execution_us] += 1
        self._lateness[lateness_us] += 1
        if lateness_us + execution_us > self.period_us:
            self.late += 1  # it ended after the next release

    @property
    def late_share(self) -> float:
        """Share of releases whose tick ended after the next one, or never ran."""
        return (self.late + self.skipped) / max(self.ticks + self.skipped, 1)

    def close_interval(self) -> GroupTiming:
        """Report the interval since the last call and start another."""
        execution, lateness = Histogram(), Histogram()
        execution.add_counted(self._execution)
        lateness.add_counted(self._lateness)
        report = GroupTiming(
            period_us=self.period_us,
            ticks=self.ticks,
            late_ticks=self.late,
            skipped_ticks=self.skipped,
            execution_p50_us=execution.percentile_us(0.50),
            execution_p99_us=execution.percentile_us(0.99),
            execution_max_us=execution.max_us,
            lateness_p50_us=lateness.percentile_us(0.50),
            lateness_p99_us=lateness.percentile_us(0.99),
            lateness_max_us=lateness.max_us,
            load=execution.total_us / (self.period_us * execution.count) if execution.count else 0,
        )
        self.execution.absorb(execution)
        self.lateness.absorb(lateness)
        self._execution.clear()
        self._lateness.clear()
        return report
