"""What a solver answers."""

from __future__ import annotations

from dataclasses import dataclass

from fsw.model.prediction import Array
from fsw.signals import SolverStatus


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
