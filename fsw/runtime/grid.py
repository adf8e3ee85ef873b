"""Absolute releases on the monotonic clock."""

from __future__ import annotations


class Grid:
    """Release times ``start + k * period``: what is missed is skipped, and the grid stays."""

    def __init__(self, start_us: float, period_us: int) -> None:
        """Begin.

        Args:
            start_us: The first release.
            period_us: Between two releases.
        """
        self.index = -1  # of the last release
        self.skipped = 0  # releases that were never taken
        self._start_us = start_us
        self._period_us = period_us

    def advance(self, now_us: int) -> int:
        """Go on to the next release worth taking; returns how many grid steps that is.

        A release whose period is not over yet is still taken, late; one whose period is over is
        skipped. A clock that jumps back makes the loop wait for the next release, not repeat one.
        """
        current = int((now_us - self._start_us) // self._period_us)
        steps = max(current - self.index, 1)
        self.index += steps
        self.skipped += steps - 1
        return steps

    @property
    def due_us(self) -> int:
        """When the release of now is or was due."""
        return round(self._start_us + self.index * self._period_us)

    def steer(self, shift_us: float) -> None:
        """Move all coming releases: the sensors' clock is not quite ours."""
        self._start_us += shift_us
