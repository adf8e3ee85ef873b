"""Absolute releases on the monotonic clock."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class ReleaseSchedule:
    """Releases at ``start + k * period``. Missed ones are skipped; the others do not move."""

    start_us: float  # of release 0 [us, monotonic]
    period_us: int
    index: int = -1  # of the last release
    skipped: int = 0  # releases that were never taken

    def advance(self, now_us: int) -> int:
        """Go to the next release whose period is not over at ``now_us`` [us]; returns the steps.

        A release whose period is not over yet is still taken, late; one whose period is over is
        skipped. If the clock jumps back, the next release is waited for, and none is repeated.
        """
        current = int((now_us - self.start_us) // self.period_us)
        steps = max(current - self.index, 1)
        self.index += steps
        self.skipped += steps - 1
        return steps

    @property
    def due_us(self) -> int:
        """When the current release is or was due [us, monotonic]."""
        return round(self.start_us + self.index * self.period_us)

    def shift(self, shift_us: float) -> None:
        """Move all coming releases by ``shift_us`` [us]: the sensors' clock differs from ours."""
        self.start_us += shift_us
