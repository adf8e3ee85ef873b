"""How long ticks take and how late they start: bounded memory, cheap enough for every tick."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

from fsw.autopilot.ports import GroupTiming

_EXACT_US: Final = 4096  # longer ones are counted to three digits, so that they are few


class Histogram:
    """Counts of durations, in whole microseconds."""

    def __init__(self, durations_us: Sequence[float] = ()) -> None:
        """Count some durations [us], as the clock counts them."""
        self.max_us = max(durations_us, default=0.0)
        self._counts = Counter(map(_rounded, durations_us))

    @property
    def count(self) -> int:
        """How many durations were added."""
        return sum(self._counts.values())

    @property
    def total_us(self) -> float:
        """Their sum [us]."""
        return sum(times * duration for duration, times in self._counts.items())

    def add(self, duration_us: float) -> None:
        """Count one more."""
        self.max_us = max(self.max_us, duration_us)
        self._counts[_rounded(duration_us)] += 1

    def percentile_us(self, share: float) -> float:
        """Duration [us] that a ``share`` [1] of all counts does not exceed; 0 before the first."""
        wanted = share * self.count
        seen = 0
        for duration, times in sorted(self._counts.items()):
            seen += times
            if seen >= wanted:
                return min(float(duration), self.max_us)
        return 0.0

    def absorb(self, other: Histogram) -> None:
        """Add the counts of another histogram."""
        self.max_us = max(self.max_us, other.max_us)
        self._counts.update(other._counts)


def _rounded(duration_us: float) -> float:
    return duration_us if duration_us < _EXACT_US else float(f"{duration_us:.3g}")


class GroupTimer:
    """Timing of one rate group: of the last interval and of the whole flight."""

    def __init__(self, period_us: int) -> None:
        self.period_us = period_us
        self.ticks = 0  # counted since the start
        self.late = 0
        self.skipped = 0
        self.execution, self.lateness = Histogram(), Histogram()  # up to the last interval
        self._execution: list[float] = []  # of this interval
        self._lateness: list[float] = []

    def add(self, execution_us: float, lateness_us: float = 0.0) -> None:
        """Count one tick by its times [us]."""
        self.ticks += 1
        self._execution.append(execution_us)
        self._lateness.append(lateness_us)
        if lateness_us + execution_us > self.period_us:
            self.late += 1  # it ended after the next release

    @property
    def late_share(self) -> float:
        """Share of releases whose tick ended after the next one, or never ran."""
        return (self.late + self.skipped) / max(self.ticks + self.skipped, 1)

    def close_interval(self) -> GroupTiming:
        """Report the interval since the last call and start another."""
        execution, lateness = Histogram(self._execution), Histogram(self._lateness)
        self._execution, self._lateness = [], []
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
        return report
