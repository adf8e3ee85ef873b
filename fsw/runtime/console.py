"""What goes wrong in flight, on the console as well: warnings and worse, each once.

The station and the log get the same texts. A thread prints: a terminal that is stopped, or a reader
that does not read, must not stop a tick. What waits for it is bounded, and the rest is counted.
"""

from __future__ import annotations

import queue
import threading
from typing import Final

from command_line.process import Events
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.signals import Severity, StatusText
from fsw.link.text_limiter import REPEAT_US, TextLimiter

_ROOM: Final = 256  # texts that wait for the console
_PATIENCE_S: Final = 0.5  # at the end, for a console that is behind
_SECOND_US: Final = 1_000_000
# RunFiles says on the console which file it is and why, at once.
_KNOWN: Final = Condition.LOG_STOPPED.value


class Console:
    """Warnings of one flight, with the flight time; the same text again is counted for 5 s."""

    def __init__(self, events: Events, start_us: int) -> None:
        """Report ``text`` events; the flight begins at ``start_us`` [us] of the vehicle's time."""
        self._events = events
        self._start_us = self._now_us = self._looked_us = start_us
        self._limiter = TextLimiter()
        self._waiting: queue.Queue[tuple[StatusText, int] | None] = queue.Queue(maxsize=_ROOM)
        self._dropped = 0
        self._thread = threading.Thread(target=self._work, name="console", daemon=True)
        self._thread.start()

    def observe(self, t_us: int, texts: tuple[StatusText, ...]) -> None:
        """Take the texts of a tick at ``t_us`` [us]; call it every tick, it never waits."""
        self._now_us = t_us
        for text in texts:
            known = text.event is not None and text.event.condition == _KNOWN
            if text.severity <= Severity.WARNING and not known:
                admitted = self._limiter.admit(text, t_us)
                if admitted is not None:
                    self._put(admitted, t_us)
        if t_us - self._looked_us >= _SECOND_US:
            self._looked_us = t_us
            self._count(t_us)

    def close(self) -> None:
        """Print what is left; safe to call twice."""
        self._count(self._now_us + REPEAT_US)  # whatever was held back
        if self._dropped:
            left_out = StatusText(Severity.WARNING, f"{self._dropped} more texts were left out")
            self._dropped = 0
            self._put(left_out, self._now_us)
        try:
            self._waiting.put(None, timeout=_PATIENCE_S)
        except queue.Full:
            return
        self._thread.join(_PATIENCE_S)

    def _count(self, t_us: int) -> None:
        for text in self._limiter.overdue(t_us):
            self._put(text, self._now_us)

    def _put(self, text: StatusText, t_us: int) -> None:
        try:
            self._waiting.put_nowait((text, t_us))
        except queue.Full:
            self._dropped += 1

    def _work(self) -> None:
        while (one := self._waiting.get()) is not None:
            text, t_us = one
            t_s = 1e-6 * (t_us - self._start_us)
            try:
                self._events.report(
                    "text",
                    f"fsw: {t_s:.1f} s: {text.text}",
                    t_s=t_s,
                    severity=int(text.severity),
                    text=text.text,
                )
            except OSError:
                return  # the reader has left; the flight goes on, and its log has the texts
