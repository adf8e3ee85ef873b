"""A safe set on its way: its zones go one after the other, from the first to the last."""

from __future__ import annotations

from typing import Final
from zlib import crc32

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.signals import SafeSet, Zone
from fsw.link.wire.decode import IndexedObstacle
from fsw.link.wire.outgoing import WireValues
from fsw.record import padded

_NUMBERS: Final = 16  # of an OBSTACLE_SHAPE
_NOT_TOUCHED: Final = (0.0,) * 5  # its numbers of contact
_TOUCH: Final = 2  # PANDION_SHAPE_FLAGS


def shape_values(zones: tuple[Zone, ...], target_system: int = 0) -> list[WireValues]:
    """An OBSTACLE_SHAPE for each of the ``zones`` of a set, for a ``target_system`` [1]; 0: any."""
    set_id = crc32(repr(zones).encode()) or 1
    return [
        (
            *(zone.t_us, zone.clearance, *zone.velocity),
            *padded(zone.shape.numbers, _NUMBERS),
            *(target_system, 0, index, len(zones), kind_of(zone.shape).number),
            int(zone.keep_in) | (0 if zone.touch is None else _TOUCH),
            *(_NOT_TOUCHED if zone.touch is None else zone.touch),
            set_id,
        )
        for index, zone in enumerate(zones)
    ]


class ZoneTransfer:
    """Collects the zones of one source's set; those of two sets never mix.

    The first zone begins a set. What does not follow the zone before it, one was lost or refused,
    ends it.
    """

    def __init__(self) -> None:
        self._came: list[IndexedObstacle] = []
        self.is_lost = False  # zones come that are of no whole set

    @property
    def is_whole(self) -> bool:
        """Whether the last zone has come."""
        return bool(self._came) and len(self._came) == self._came[0].count

    @property
    def is_begun(self) -> bool:
        """Whether zones are still to come."""
        return bool(self._came) and not self.is_whole

    def add(self, indexed: IndexedObstacle) -> SafeSet | None:
        """Take the next zone; the set once it is whole. A datagram that came twice counts once."""
        came = self._came
        if indexed.index == 0:
            came, self.is_lost = [], False
        elif came and indexed == came[-1]:
            return None
        follows = indexed.index == len(came)
        if came:
            last = came[-1]
            follows &= (indexed.count, indexed.set_id) == (last.count, last.set_id)
        if self.is_lost or not follows:
            self.discard()
            return None
        self._came = [*came, indexed]
        return SafeSet(tuple([one.zone for one in self._came])) if self.is_whole else None

    def discard(self) -> None:
        """Do without the zones of this set, those that are still to come as well."""
        self._came, self.is_lost = [], True
