"""What the loop needs from the outside world, as protocols: tests put their own behind them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from fsw.signals import Plan, PlanFailure, PlanRequest

Clock = Callable[[], int]
"""Monotonic wall time [us]. Measures the loop; no law ever sees it."""


class PlanningCycle(Protocol):
    """One planning cycle, with whatever memory it keeps from the last one."""

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        """Answer one request; blocks for as long as the optimisation takes."""
        ...


class PlanService(Protocol):
    """The planner as the tick sees it: ask now, look later, never wait."""

    def submit(self, request: PlanRequest) -> None:
        """Take a request; a newer one replaces one that has not been started."""
        ...

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """Return an answer that is there and due at ``t_us``, once."""
        ...

    def close(self) -> None:
        """Stop planning; what is under way is abandoned."""
        ...
