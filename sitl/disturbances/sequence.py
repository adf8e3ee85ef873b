"""A disturbance that was written down, value by value, and is played back."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sitl.scenario import V3

_STILL: V3 = (0.0, 0.0, 0.0)


class Steered:
    """An acceleration [m/s², NED] that somebody else sets before each step."""

    torque = False

    def __init__(self) -> None:
        self.value: V3 = _STILL

    def sample(self, step: int) -> V3:
        """See ``Push``."""
        return self.value

    def held_until(self, step: int) -> float:
        """See ``Push``: it may be set in every step."""
        return step + 1


class Played:
    """Accelerations [m/s², NED], each held for ``every`` steps, from the step ``first`` on."""

    torque = False

    def __init__(self, values: Sequence[V3], first: int, every: int) -> None:
        self._values = values
        self._first = first
        self._every = every

    def sample(self, step: int) -> V3:
        """See ``Push``; nothing before the first and after the last."""
        index = (step - self._first) // self._every
        return self._values[index] if 0 <= index < len(self._values) else _STILL

    def held_until(self, step: int) -> float:
        """See ``Push``."""
        index = max((step - self._first) // self._every, -1)
        return self._first + (index + 1) * self._every if index < len(self._values) else math.inf
