"""Wall time, in one place. It measures the loop and paces waits; no law ever sees it."""

from __future__ import annotations

import time


def now_us() -> int:
    """Monotonic wall time [us]."""
    return time.perf_counter_ns() // 1000


def stopwatch_us() -> float:
    """Monotonic wall time with a finer grain, for the stages of a planning cycle [us]."""
    return time.perf_counter_ns() * 1e-3


def unix_us() -> int:
    """Calendar time, only to stamp logs [us since 1970]."""
    return time.time_ns() // 1000
