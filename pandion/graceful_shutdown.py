"""Ends a process in stages: wait, interrupt, kill."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pandion.child import Child

GRACE_S: Final = 0.6  # between one way to end a process and the next, stronger one


@dataclass(slots=True)
class GracefulShutdown:
    """The shutdown of one process; nothing happens before its end is due."""

    child: Child
    due_s: float | None = None  # on the monotonic clock: when the next step is taken
    _grace_s: float = GRACE_S
    _asked: bool = False

    def expect(self, due_s: float, grace_s: float = GRACE_S) -> None:
        """Set when it must have ended; the earlier of two times counts."""
        if self.due_s is None or due_s < self.due_s:
            self.due_s, self._grace_s = due_s, grace_s

    def escalate(self, now_s: float) -> None:
        """After that time, interrupt it; at the next call, kill it."""
        if self.due_s is None or now_s < self.due_s:
            return
        if self.child.exit_code is not None:
            self.due_s = None
            return
        if self._asked:
            self.child.kill()
        else:
            self.child.interrupt()
        self._asked = True
        self.due_s = now_s + self._grace_s
