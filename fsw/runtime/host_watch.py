"""What the loop finds out about its machine once a second, for the tick to act on.

The tick knows no clock, disk or socket. What it is told is an input like any other: it is logged,
and a replay repeats it. Numbers are rounded, so that there is news only where something changes.
"""

from __future__ import annotations

from typing import Final

from fsw.autopilot.flight.failsafe.evidence import JUMP_US, MISSED_TICKS
from fsw.autopilot.ports import Clock
from fsw.autopilot.signals import HostHealth
from fsw.link.ground_links import GroundLinks
from fsw.log.flight_log import RunFiles

_FEW: Final = 100  # datagrams/s; fewer are not worth a number
_ENOUGH_S: Final = 60.0  # for which a disk should take the log
_STEP_S: Final = 5.0
_MIN_RATE: Final = 1e5  # bytes/s of a log that has only begun


class HostWatch:
    """Looks at one machine; ``look`` is called once a second of the vehicle's time."""

    def __init__(
        self, disk: RunFiles, ground: GroundLinks, clock: Clock, wall_clock: Clock
    ) -> None:
        self._disk = disk
        self._ground = ground
        self._clock = clock
        self._wall_clock = wall_clock
        self._last = HostHealth()
        self._looked_us = self._begun_us = clock()
        self._wall_us = wall_clock()
        self._missed = 0
        self._received = 0

    def look(self, missed: int) -> HostHealth | None:
        """The machine's health where it is news; ``missed`` ticks [1] there were since start."""
        now_us, wall_us = self._clock(), self._wall_clock()
        elapsed_us = max(now_us - self._looked_us, 1)
        received = self._ground.received
        rate = 1e6 * (received - self._received) / elapsed_us
        jump_us = wall_us - self._wall_us - elapsed_us
        lately = missed - self._missed
        found = HostHealth(
            missed_ticks=lately if lately >= MISSED_TICKS else 0,
            log_failure=self._disk.failure(),
            disk_left_us=self._disk_left_us(now_us),
            datagrams=_FEW * round(rate / _FEW),
            clock_jump_us=jump_us if abs(jump_us) >= JUMP_US else 0,
        )
        self._looked_us, self._wall_us = now_us, wall_us
        self._missed, self._received = missed, received
        if found == self._last:
            return None
        self._last = found
        return found

    def _disk_left_us(self, now_us: int) -> int:
        """How long the disk will take the log, where that is not long; -1: it is."""
        elapsed = 1e-6 * max(now_us - self._begun_us, 1_000_000)
        rate = max(self._disk.size / elapsed, _MIN_RATE)
        left = self._disk.room() / rate
        return -1 if left >= _ENOUGH_S else round(1e6 * _STEP_S * (left // _STEP_S))
