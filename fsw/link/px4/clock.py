"""PX4's time in the vehicle's, and how far away PX4 is.

The vehicle's time is PX4's, as its messages are stamped; after a restart of PX4, whose time then
begins anew, it goes on. TIMESYNC is answered, and asked: half of a round trip is how long a message
is under way, which is part of the delay that plans count on.
"""

from __future__ import annotations

from typing import Final

from fsw.link.px4.messages import CompanionWriter

ASK_US: Final = 1_000_000
_KEPT: Final = 32
_BACK_US: Final = 300_000  # a stamp that is so much behind is of another start


class Px4Clock:
    """Stamps of one PX4."""

    def __init__(self) -> None:
        self.ahead_us = 0  # of the vehicle's time over PX4's
        self.restarts = 0
        self._newest_us = 0  # vehicle's time
        self._stamp_us = 0  # PX4's
        self._trips_us: list[int] = []

    def take(self, stamp_us: int) -> bool:
        """Take a stamp of PX4 [us]; whether PX4 has started anew since the last one.

        Vehicle's time goes on where PX4's begins anew, or has stood still while PX4 was silent.
        """
        again = stamp_us < self._stamp_us - _BACK_US
        self.restarts += again
        self._stamp_us = stamp_us
        behind_us = self._newest_us - (stamp_us + self.ahead_us)
        if behind_us > _BACK_US or (again and behind_us > 0):
            self.ahead_us += behind_us + 1
        self._newest_us = max(self._newest_us, stamp_us + self.ahead_us)
        return again

    def passed(self, t_us: int) -> None:
        """Vehicle's time [us] has gone on without a stamp: PX4 is silent."""
        self._newest_us = max(self._newest_us, t_us)

    def answer(self, answered_ns: int, sent_ns: int, now_us: int, writer: CompanionWriter) -> bytes:
        """What a TIMESYNC of PX4 is answered, at ``now_us`` [us] of ours; nothing to an answer."""
        if answered_ns == 0:
            return writer.time_sync(1000 * now_us, sent_ns)
        trip_us = now_us - sent_ns // 1000
        if 0 <= trip_us < ASK_US:
            self._trips_us = [*self._trips_us[-_KEPT + 1 :], trip_us]
        return b""

    @property
    def round_trip_us(self) -> int | None:
        """Of late, the median; None: PX4 has not answered yet."""
        trips = sorted(self._trips_us)
        return trips[len(trips) // 2] if trips else None
