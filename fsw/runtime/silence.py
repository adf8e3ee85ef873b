"""How long the simulator has been silent, as far as anybody listened."""

from __future__ import annotations

from typing import Final

from fsw.ports import Clock

# A release waits for less. What takes longer is this process standing still, and a suspended
# machine finds both halves as it left them.
_MOST_US: Final = 250_000


class Silence:
    """Grows by the time between two looks, by no more than a release may wait."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._looked_us = clock()
        self._us = 0

    def end(self, now_us: int) -> None:
        """Something was heard."""
        self._looked_us, self._us = now_us, 0

    def grow(self) -> int:
        """Nothing was; returns for how long now [us]."""
        now_us = self._clock()
        self._us += min(now_us - self._looked_us, _MOST_US)
        self._looked_us = now_us
        return self._us
