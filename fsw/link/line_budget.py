"""What a line of limited speed may be given, so that nothing important waits behind the rest.

The line is never planned more than 80 % full: its clock, and the radio behind it, are slower now
and then. Telemetry is planned for 60 %; answers, parameters and files have the rest.
"""

from __future__ import annotations

from typing import Final

from fsw.autopilot.ports import Clock

FULL: Final = 0.8  # of what the line carries
TELEMETRY: Final = 0.6  # of it
_BURST_S: Final = 0.1  # of that share may leave at once
_LONGEST: Final = 1400  # bytes of what can wait, which are sent as one


class LineBudget:
    """Counts what was sent on one line against wall time, however fast the vehicle's time goes."""

    def __init__(self, bytes_per_s: float, clock: Clock) -> None:
        """Begin with an empty line that carries ``bytes_per_s``; the clock is wall time [us]."""
        self._rate = FULL * bytes_per_s
        self._most = self._level = _BURST_S * self._rate
        self._clock = clock
        self._counted_us = clock()

    def spend(self, size: int) -> None:
        """Count ``size`` [bytes] that are sent; what is urgent may overdraw."""
        self._count()
        self._level -= size

    def has_room(self) -> bool:
        """Whether what can wait may be sent now: parameters, files."""
        self._count()
        return self._level > 0.0

    def takes_telemetry(self) -> bool:
        """Whether telemetry may be sent now; what was sent before it of what can wait is no reason.

        In real time it always may. Where the vehicle's time goes faster, some of it is left out.
        """
        self._count()
        return self._level > -self._most - _LONGEST

    def _count(self) -> None:
        now_us = self._clock()
        earned = 1e-6 * (now_us - self._counted_us) * self._rate
        self._level = min(self._level + earned, self._most)
        self._counted_us = now_us
