"""When the machine stood still, and which missed releases lie elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from fsw.runtime.releases import MAX_STALE_TICKS

Stretch = tuple[int, int]  # from, to: wall time in microseconds


class Stops:
    """Stretches in which a sleeping loop on one of the processors was not woken."""

    def __init__(self, late: Sequence[Sequence[Stretch]], period_us: int) -> None:
        """Take what the loops saw.

        Args:
            late: For each processor, the releases of its loop that were late: when they were due
                and when the loop ran.
            period_us: Of the flight.
        """
        self.late = late
        self._period_us = period_us
        # A stop began before it was seen. Behind it the vehicle finds its frames again, for as
        # long as it flies on old readings.
        behind_us = MAX_STALE_TICKS * period_us
        self._stretches = _united(
            (due_us - period_us, woken_us + behind_us) for one in late for due_us, woken_us in one
        )

    def share(self, begin_us: int, releases: int) -> float:
        """Share of the time for which a sleeping loop was not woken, mean of the processors.

        Args:
            begin_us: First release of the flight.
            releases: Of the flight.
        """
        length_us = releases * self._period_us
        during = (
            woken_us - due_us
            for one in self.late
            for due_us, woken_us in one
            if begin_us <= due_us < begin_us + length_us
        )
        return sum(during) / max(length_us * len(self.late), 1)

    def missed_elsewhere(
        self, missed: Iterable[Sequence[int]], begin_us: int, releases: int
    ) -> float:
        """Share of the releases that were missed though every processor ran.

        Args:
            missed: Releases of the flight in a row: when the first and the last were due.
            begin_us: First release of the flight.
            releases: Of the flight.
        """
        period_us = self._period_us
        ours = sum(
            self._all_ran(due_us)
            for first_us, last_us in missed
            for due_us in range(first_us, last_us + period_us // 2, period_us)
        )
        end_us = begin_us + releases * period_us
        parts = ((max(begin, begin_us), min(end, end_us)) for begin, end in self._stretches)
        stood_us = sum(max(end - begin, 0) for begin, end in parts)
        return ours / max(releases - stood_us / period_us, 1.0)

    def _all_ran(self, due_us: int) -> bool:
        return not any(begin <= due_us <= end for begin, end in self._stretches)


def _united(stretches: Iterable[Stretch]) -> list[Stretch]:
    """In order, overlapping ones joined."""
    united: list[Stretch] = []
    for begin, end in sorted(stretches):
        if united and begin <= united[-1][1]:
            united[-1] = (united[-1][0], max(end, united[-1][1]))
        else:
            united.append((begin, end))
    return united
