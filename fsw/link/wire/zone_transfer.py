"""A safe set on its way: its zones come one after the other, from the first to the last."""

from __future__ import annotations

from zlib import crc32

from fsw.autopilot.signals import SafeSet, Zone
from fsw.link.wire.decode import IndexedObstacle


def set_id_of(zones: tuple[Zone, ...]) -> int:
    """A number that all of these ``zones`` share, and those of another set do not."""
    return crc32(repr(zones).encode()) or 1


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
        of = indexed.count, indexed.set_id
        follows = indexed.index == len(came) and all((one.count, one.set_id) == of for one in came)
        if self.is_lost or not follows:
            self.discard()
            return None
        self._came = [*came, indexed]
        return SafeSet(tuple([one.zone for one in self._came])) if self.is_whole else None

    def discard(self) -> None:
        """Do without the zones of this set, those that are still to come as well."""
        self._came, self.is_lost = [], True
