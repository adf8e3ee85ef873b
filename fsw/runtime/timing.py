"""How long ticks take and how late they start: bounded memory, cheap enough for every tick."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from typing import Final

from fsw.ports import GroupTiming

_BINS_PER_E: Final = 50.0  # 2 % resolution
_BINS: Final = 900  # up to exp(18) us, about a minute


class Histogram:
    """Counts of durations in bins that grow by 2 %."""

    def __init__(self) -> None:
        self.count = 0
        self.total_us = 0.0
        self.max_us = 0.0
        self._bins = defaultdict[int, int](int)  # those that have counts: a few of all

    def add(self, duration_us: float, times: int = 1) -> None:
        """Count a duration [us]; anything below 1 us is in the first bin."""
        self.count += times
        self.total_us += times * duration_us
        if duration_us > self.max_us:
            self.max_us = duration_us
        index = int(math.log(duration_us) * _BINS_PER_E) if duration_us > 1.0 else 0
        self._bins[min(index, _BINS - 1)] += times

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
    """Timing of one rate group: of the last interval and of the whole flight."""

    def __init__(self, period_us: int) -> None:
        self.period_us = period_us
        self.ticks = 0  # counted since the start
        self.late = 0
        self.skipped = 0
        self.execution = Histogram()  # whole flight, up to the last interval
        self.lateness = Histogram()
        # Of this interval, how often each was measured: its end sorts them into bins.
        self._execution = defaultdict[float, int](int)
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
        execution, lateness = _binned(self._execution), _binned(self._lateness)
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


def _binned(times: Mapping[float, int]) -> Histogram:
    """How often each duration [us] was measured, in bins."""
    binned = Histogram()
    for duration_us, count in times.items():
        binned.add(duration_us, count)
    return binned
