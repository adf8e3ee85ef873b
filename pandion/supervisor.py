"""Watches both halves of a flight until both have ended; leaves nothing running."""

from __future__ import annotations

import selectors
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, Final

from pandion.children import Child, Event
from pandion.display import Display
from pandion.parser import COULD_NOT_START
from pandion.processor import ANYWHERE, Places

_LISTEN_S: Final = 30.0  # until sitl has bound its port
_FOLLOW_S: Final = 3.0  # one half ends this soon after the other
_STALLED_S: Final = 0.08  # the same for a half that is silent: it has had its time
_GRACE_S: Final = 0.6  # between one way to end a half and the next, stronger one


class HalfFailed(Exception):
    """A half could not start, in one sentence."""

    def __init__(self, sentence: str, exit_code: int = COULD_NOT_START) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code


@dataclass(slots=True)
class Flown:
    """What the halves said."""

    sitl: dict[str, Any] | None = None  # the simulator's result
    errors: dict[str, str] = field(default_factory=dict)  # by half
    port: int | None = None
    duration_s: float = 1.0
    started: bool = False
    interrupted: bool = False

    @property
    def failure(self) -> str | None:
        """Every error in one sentence, None if there was none."""
        return "; ".join(self.errors.values()) or None


class Supervisor:
    """Starts sitl, then fsw, and sees both to their end."""

    def __init__(
        self, display: Display, out: Path, places: Places = ANYWHERE, runner: str | None = None
    ) -> None:
        self._display = display
        self._places = places
        self._runner = runner
        self._out = out
        self._flown = Flown()
        self._children: list[Child] = []
        self._selector = selectors.DefaultSelector()
        self._deadline_s: float | None = None  # when a half that is left is made to end
        self._interrupted_all = False
        self._grace_s = _GRACE_S

    def fly(self, sitl: list[str], fsw: Callable[[int], list[str]]) -> Flown:
        """Run one flight.

        Args:
            sitl: Command line of the simulator.
            fsw: Command line of the flight software, given the simulator's port.

        Raises:
            HalfFailed: The flight did not begin.
        """
        previous = {
            number: signal.signal(number, self._interrupt)
            for number in (signal.SIGINT, signal.SIGTERM)
        }
        try:
            self._start("sitl", sitl, self._places.sitl)
            self._watch(lambda: self._flown.port is not None, _LISTEN_S)
            if self._flown.port is not None and not self._flown.interrupted:
                self._start("fsw", fsw(self._flown.port), self._places.fsw)
                with self._display.flight(self._flown.duration_s):
                    self._watch(lambda: False, None)
                self._display.end()
        finally:
            self._end_all()
            for number, handler in previous.items():
                signal.signal(number, handler)
        if not self._flown.started:
            self._explain()
        return self._flown

    def _explain(self) -> None:
        """Raise what kept the flight from beginning."""
        if self._flown.interrupted:
            raise HalfFailed("interrupted before the flight began", exit_code=1)
        raise HalfFailed(self._flown.failure or "the simulator did not start")

    def _start(self, name: str, arguments: list[str], processor: int | None) -> None:
        child = Child(name, arguments, self._out / f"{name}.log", processor, self._runner)
        self._children.append(child)
        self._selector.register(child, selectors.EVENT_READ)

    def _watch(self, done: Callable[[], bool], patience_s: float | None) -> None:
        """Take in events until ``done``, both halves have ended or the patience is over."""
        until_s = None if patience_s is None else time.monotonic() + patience_s
        while self._selector.get_map() and not done():
            if until_s is not None and time.monotonic() > until_s:
                return
            for key, _ in self._selector.select(timeout=0.1):
                child = key.fileobj
                assert isinstance(child, Child)
                events = child.events()
                if events is None:
                    self._selector.unregister(child)
                    self._ended(child)
                else:
                    for event in events:
                        self._take(child, event)
            self._hurry()

    def _take(self, child: Child, event: Event) -> None:
        kind, flown = event["event"], self._flown
        if kind == "progress":
            self._display.progress(event["t_s"], event["min_margin_m"], event["real_time_factor"])
        elif kind == "error":
            flown.errors[child.name] = event["message"]
        elif kind == "listening":
            flown.port, flown.duration_s = event["port"], event["duration_s"]
            self._display.say(event["message"])
        elif kind == "flying":
            flown.started = True
        elif kind == "ended":
            self._note_end(child, event)
        if kind in ("preparing", "warning", "parameters"):
            self._display.say(event["message"])

    def _note_end(self, child: Child, event: Event) -> None:
        """Keep the result; a half that ends because the other is silent does not wait for it."""
        if child.name == "sitl":
            self._flown.sitl = event["result"]
            silent = event["vehicle_silent"]
        else:
            silent = event["ending"] == "link lost"
            if silent:
                self._flown.errors["fsw"] = event["message"]
        if silent:
            self._grace_s = _STALLED_S
            self._deadline_s = time.monotonic() + _STALLED_S

    def _ended(self, child: Child) -> None:
        """A half is gone: note a crash, and give the other one a moment to follow."""
        child.end(patience_s=1.0)
        code = child.exit_code
        killed = self._interrupted_all and code is not None and code < 0
        if code not in (0, 1, 2) and not killed and child.name not in self._flown.errors:
            log = self._out / f"{child.name}.log"
            self._flown.errors[child.name] = f"{child.name} ended with code {code}; see {log}"
        if self._deadline_s is None:
            # Before the flight there is no link whose silence the other half would notice.
            wait_s = _FOLLOW_S if self._flown.started else 0.0
            self._deadline_s = time.monotonic() + wait_s

    def _hurry(self) -> None:
        """Past the deadline: interrupt what still runs, then kill it."""
        if self._deadline_s is None or time.monotonic() < self._deadline_s:
            return
        self._deadline_s = time.monotonic() + self._grace_s
        for child in self._children:
            if self._interrupted_all:
                child.kill()
            else:
                child.interrupt()
        self._interrupted_all = True

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        """End the simulator, which ends the flight software and still gives a result."""
        self._flown.interrupted = True
        self._deadline_s = time.monotonic() + _GRACE_S
        for child in self._children[:1]:
            child.interrupt()

    def _end_all(self) -> None:
        for child in self._children:
            if child.exit_code is None:
                child.interrupt()
        for child in self._children:
            child.end(patience_s=1.0)
        self._selector.close()
