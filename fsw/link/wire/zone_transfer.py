"""A safe set from the messages that carry its zones: whole, or not at all."""

from __future__ import annotations

from fsw.autopilot.signals import SafeSet, Zone
from fsw.link.wire.decode import IndexedObstacle


class ZoneTransfer:
    """One transfer: index 0 begins it, and the indices follow without a gap.

    An exact repeat of the last one is ignored. Anything else discards what has come: the zones of
    two sets must not mix.
    """

    def __init__(self) -> None:
        self._zones: list[Zone] = []
        self._last: IndexedObstacle | None = None

    def add(self, indexed: IndexedObstacle) -> SafeSet | None:
        """Take the next zone; the set, once it is whole."""
        last = self._last
        if indexed == last:
            return None
        follows = last is not None and (indexed.index, indexed.count) == (
            last.index + 1,
            last.count,
        )
        if not follows:
            self.discard()
            if indexed.index != 0:
                return None
        self._zones.append(indexed.zone)
        self._last = indexed
        if indexed.index + 1 < indexed.count:
            return None
        whole = SafeSet(tuple(self._zones))
        self.discard()
        return whole

    def discard(self) -> None:
        """Forget what has come: a zone of the set is refused, or not known."""
        self._zones, self._last = [], None
