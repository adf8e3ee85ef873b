"""Watches both halves of a flight until both have ended; leaves nothing running."""

from __future__ import annotations

import math
import selectors
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, Final

from command_line.parser import COULD_NOT_START
from pandion.children import Child, Event
from pandion.display import Display
from pandion.leaving import GRACE_S, Leaving
from pandion.processor import ANYWHERE, Places

_LISTEN_S: Final = 30.0  # until sitl has bound its port
_FOLLOW_S: Final = 3.0  # one half ends this soon after the other
_STALLED_S: Final = 0.08  # the same for a half that is silent: it has had its time


class HalfFailed(Exception):
    """A half could not start, in one sentence."""

    def __init__(self, sentence: str, exit_code: int = COULD_NOT_START) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code


@dataclass(slots=True)
class Flown:
    """What the halves said."""

    sitl: dict[str, Any] | None = None  # the simulator's result
    fsw: dict[str, Any] | None = None  # the flight software's
    errors: dict[str, str] = field(default_factory=dict)  # by half
    aftermath: list[str] = field(default_factory=list)  # what went wrong behind the flight
    unwritten: list[str] = field(default_factory=list)  # results that did not get to the disk
    port: int | None = None
    duration_s: float = 1.0
    started: bool = False
    interrupted: bool = False

    @property
    def cause(self) -> str | None:
        """What the halves ended of by themselves, in one sentence; None if it was nothing bad."""
        return "; ".join(self.errors.values()) or None

    @property
    def failure(self) -> str | None:
        """Everything that went wrong, None if nothing did."""
        return "; ".join((*self.errors.values(), *self.aftermath)) or None


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
        self._halves: list[Leaving] = []
        self._selector = selectors.DefaultSelector()

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
        child = Child(name, arguments, self._log(name), processor, self._runner)
        self._halves.append(Leaving(child))
        self._selector.register(child, selectors.EVENT_READ)

    def _watch(self, done: Callable[[], bool], patience_s: float | None) -> None:
        """Take in events until ``done``, both halves have ended or the patience is over."""
        until_s = None if patience_s is None else time.monotonic() + patience_s
        while self._selector.get_map() and not done():
            if until_s is not None and time.monotonic() > until_s:
                return
            for key, _ in self._selector.select(timeout=self._patience_s()):
                child = key.fileobj
                assert isinstance(child, Child)
                events = child.events()
                if events is None:
                    self._selector.unregister(child)
                    self._ended(child)
                else:
                    for event in events:
                        self._take(child, event)
            now_s = time.monotonic()
            for half in self._halves:
                half.hurry(now_s)

    def _patience_s(self) -> float:
        """Until the next thing that has its time [s]."""
        due_s = [half.due_s for half in self._halves if half.due_s is not None]
        return min(max(min(due_s, default=math.inf) - time.monotonic(), 0.0), 0.1)

    def _expect(self, halves: list[Leaving], within_s: float, grace_s: float = GRACE_S) -> None:
        until_s = time.monotonic() + within_s
        for half in halves:
            half.expect(until_s, grace_s)

    def _others(self, child: Child) -> list[Leaving]:
        return [half for half in self._halves if half.child is not child]

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
        elif kind == "unwritten":
            flown.unwritten.append(event["what"])
        if kind in ("preparing", "warning", "parameters"):
            self._display.say(event["message"])

    def _note_end(self, child: Child, event: Event) -> None:
        """Keep the result; a half that ends because the other is silent does not wait for it."""
        if child.name == "sitl":
            self._flown.sitl = event["result"]
            silent = event["vehicle_silent"]
        else:
            self._flown.fsw = event["result"]
            silent = event["ending"] == "link lost"
            if silent:
                self._flown.errors["fsw"] = event["message"]
        others = self._others(child)
        self._expect([half for half in self._halves if half not in others], _FOLLOW_S)
        if silent:
            self._expect(others, _STALLED_S, _STALLED_S)

    def _ended(self, child: Child) -> None:
        """A half is gone: note a crash, and give the other one a moment to follow."""
        child.end(patience_s=1.0)
        code, name, flown = child.exit_code, child.name, self._flown
        obeyed = child.interrupted and code == -signal.SIGINT
        if child.killed:
            flown.aftermath.append(f"{name} did not end by itself and had to be killed")
        elif code not in (0, 1, 2) and not obeyed and name not in flown.errors:
            flown.errors[name] = f"{name} ended with code {code}; see {self._log(name)}"
        elif flown.started and name not in flown.errors and self._result(name) is None:
            flown.errors[name] = f"{name} ended without a result; see {self._log(name)}"
        # Before the flight there is no link whose silence the other half would notice.
        self._expect(self._others(child), _FOLLOW_S if flown.started else 0.0)

    def _result(self, name: str) -> dict[str, Any] | None:
        return self._flown.sitl if name == "sitl" else self._flown.fsw

    def _log(self, name: str) -> Path:
        return self._out / f"{name}.log"

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        """End the simulator, which ends the flight software and still gives a result."""
        self._flown.interrupted = True
        self._expect(self._halves, GRACE_S)
        for half in self._halves[:1]:
            half.child.interrupt()

    def _end_all(self) -> None:
        for half in self._halves:
            half.child.interrupt()
        for half in self._halves:
            half.child.end(patience_s=1.0)
        self._selector.close()
