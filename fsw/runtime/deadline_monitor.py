"""Missed releases: when they were, and what the operator reads about them."""

from __future__ import annotations

from collections import Counter
from typing import Final

WARNING_INTERVAL_US: Final = 10_000_000  # vehicle time

# New ones in an interval, of 5000 ticks and 100 plans. Fewer do not concern an operator; they are
# counted in LOOP_TIMING, MPC_STATUS, the log and the result all the same.
WARNING_LIMITS: Final = {"late": 50, "skipped": 50, "without sensors": 50, "plans late": 5}

_MAX_INTERVALS: Final = 2_000  # bounds memory
_JOINED_US: Final = 3_000  # one and a half periods of the inner loop


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
