"""Motor controllers: a command takes effect after a dead time."""

from __future__ import annotations

from collections import deque


class DeadTime:
    """Delays the rotors' commands by whole exchanges."""

    def __init__(self, exchanges: int, first: tuple[float, ...]) -> None:
        """Before the first command arrives the rotors keep ``first`` (r,) [N]."""
        self._line: deque[tuple[float, ...]] = deque([first] * exchanges)

    def through(self, command: tuple[float, ...]) -> tuple[float, ...]:
        """Take the newest ``command`` (r,) [N], return the one that takes effect [N]."""
        self._line.append(command)
        return self._line.popleft()
