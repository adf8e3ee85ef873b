"""What one timed call of an optimiser gave."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from fsw.autopilot.model.prediction import Array

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Spent:
    """What a call took."""

    wall_us: float
    cpu_us: float  # of this process; a busy machine stretches only the other


@dataclass(frozen=True, slots=True)
class Solved:
    """What one timed call gave."""

    spent: Spent
    inputs: Array | None  # (6 n,), None where the method failed
    sqp_iterations: int | None
    linearise_us: float = 0.0
    solve_us: float = 0.0


def timed(call: Callable[[], Result]) -> tuple[Result, Spent]:
    """What a call gives, and the time that it took."""
    cpu, wall = time.process_time(), time.perf_counter()
    result = call()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return result, Spent(1e6 * wall, 1e6 * cpu)


def stopwatch_us() -> float:
    """Monotonic time [us]."""
    return time.perf_counter() * 1e6
