"""Where in a flight the page is, and how it goes on; knows no page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from view.scene import Event


@dataclass(frozen=True, slots=True)
class Timeline:
    """A place in a recorded flight."""

    begin: float  # s
    end: float  # s
    t: float  # s
    speed: float = 1.0  # of real time
    playing: bool = False

    def advance(self, dt: float) -> Timeline:
        """Go on by ``dt`` [s] of the viewer's time; stop at the end."""
        if not self.playing:
            return self
        t = self.t + self.speed * dt
        return replace(self, t=min(t, self.end), playing=t < self.end)

    def toggle(self) -> Timeline:
        """Play or pause; from the end, play from the beginning."""
        if not self.playing and self.t >= self.end:
            return replace(self, t=self.begin, playing=True)
        return replace(self, playing=not self.playing)

    def go_to(self, t: float) -> Timeline:
        """Stop at ``t`` [s], within the flight."""
        return replace(self, t=min(max(t, self.begin), self.end), playing=False)

    def next_event(self, events: Sequence[Event], kind: str = "") -> Timeline:
        """Stop at the next event of a kind, of any kind without one."""
        return self._first(one.t for one in events if _is(one, kind) and one.t > self.t + 1e-6)

    def previous_event(self, events: Sequence[Event], kind: str = "") -> Timeline:
        """Stop at the last event before this place."""
        before = [one.t for one in events if _is(one, kind) and one.t < self.t - 1e-6]
        return self._first(reversed(before))

    def _first(self, times: object) -> Timeline:
        t = next(iter(times), None)  # type: ignore[call-overload]
        return self if t is None else self.go_to(t)


def _is(event: Event, kind: str) -> bool:
    return kind in ("", event.kind)
