"""How long the simulator has been silent, without the time in which this process was suspended."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.ports import Clock

# A release waits for less; longer gaps mean this process was suspended. After a suspension of the
# whole machine the simulator goes on as well, so such a gap must not end the flight.
_LONGEST_GAP_US: Final = 250_000


class LinkWatchdog:
    """Adds up the time between checks without a frame."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._checked_us = clock()
        self._silent_us = 0

    def reset(self, now_us: int) -> None:
        """Start again: a frame arrived at ``now_us`` [us, monotonic]."""
        self._checked_us, self._silent_us = now_us, 0

    def check(self) -> int:
        """Time without a frame up to now [us]; a gap between checks counts 0.25 s at most."""
        now_us = self._clock()
        self._silent_us += min(now_us - self._checked_us, _LONGEST_GAP_US)
        self._checked_us = now_us
        return self._silent_us
