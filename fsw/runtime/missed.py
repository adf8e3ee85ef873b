"""When releases were missed: whoever watches the machine can hold its stops against them."""

from __future__ import annotations

from typing import Final

_MOST: Final = 2_000  # stretches; a flight that misses more has other troubles
_IN_A_ROW_US: Final = 3_000  # one and a half periods of the inner loop


class MissedReleases:
    """Releases that were late or skipped, as stretches of wall time in bounded memory."""

    def __init__(self) -> None:
        self.stretches: list[tuple[int, int]] = []  # due times of the first and the last release

    def add(self, first_us: int, last_us: int | None = None) -> None:
        """Note a release that was due at ``first_us``, or all from there to ``last_us``."""
        last_us = first_us if last_us is None else last_us
        if self.stretches and first_us - self.stretches[-1][1] < _IN_A_ROW_US:
            self.stretches[-1] = (self.stretches[-1][0], last_us)
        elif len(self.stretches) < _MOST:
            self.stretches.append((first_us, last_us))
