"""Motor controllers: a command takes effect after a dead time."""

from __future__ import annotations

from collections import deque

from sitl.plant.vector import V4


class DeadTime:
    """Delays the rotors' commands by whole exchanges."""

    def __init__(self, exchanges: int, first: V4) -> None:
        """Before the first command arrives the rotors keep ``first`` [N]."""
        self._line: deque[V4] = deque([first] * exchanges)

    def through(self, command: V4) -> V4:
        """Take the newest ``command`` [N], return the one that takes effect [N]."""
        self._line.append(command)
        return self._line.popleft()
