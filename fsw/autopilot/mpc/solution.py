"""What a solver of the planner's program is asked, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import SolverStatus


@dataclass(frozen=True, slots=True)
class Solution:
    """Outcome of one solve; ``x`` is usable only where the status is (almost) solved."""

    status: SolverStatus
    x: Array  # (unknowns,)
    iterations: int

    @property
    def usable(self) -> bool:
        """Whether ``x`` may be flown: a truncated iterate is finite but wrong."""
        return self.status in (SolverStatus.SOLVED, SolverStatus.ALMOST_SOLVED)


class QpSolver(Protocol):
    """Solves one ``QpData``, which it is built with, again and again as filled anew."""

    def solve(self, guess: Array) -> Solution:
        """Inputs and slacks at the optimum; a ``guess`` (inputs n,) [SI] may save time."""
        ...
