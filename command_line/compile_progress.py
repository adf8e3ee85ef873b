"""How far compiling is: kernels on disk of kernels in the sources, and the time left."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from command_line.kernel_cache import kept_in

_EACH_S: Final = 0.5  # between two looks at the disk
_FEW: Final = 5  # kernels after which there is a pace to speak of


class CompileProgress:
    """The kernels that several processes compile at once, each into a folder of its own."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Watch nothing yet; ``clock`` [s]."""
        self._clock = clock
        self._kernels: dict[Path, int] = {}
        self._found = 0  # on disk before
        self._begun_s = self._looked_s = clock()

    def add(self, folder: Path, kernels: int) -> None:
        """Watch a folder, into which so many kernels will be compiled or nearly so many."""
        self._kernels[folder] = kernels
        self._found += kept_in(folder)
        self._begun_s = self._clock()

    def end(self) -> None:
        """All is compiled."""
        self._kernels.clear()
        self._found = 0

    def look(self) -> tuple[int, int, str] | None:
        """Kernels that are there, how many there will be, and a sentence; None if all is said.

        Looks at the disk seldom, so it may be called often.
        """
        now_s = self._clock()
        if not self._kernels or now_s - self._looked_s < _EACH_S:
            return None
        self._looked_s = now_s
        total = sum(self._kernels.values())
        done = min(sum(map(kept_in, self._kernels)), total)
        new, passed_s = done - self._found, now_s - self._begun_s
        if new < _FEW:
            return done, total, f"{done} of {total} kernels"
        left_s = passed_s * (total - done) / new
        return done, total, f"{done} of {total} kernels, about {left_s:.0f} s left"
