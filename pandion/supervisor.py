"""Watches the two processes of a flight until both have ended; leaves nothing running."""

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

from command_line.compile_progress import CompileProgress
from command_line.parser import COULD_NOT_START
from pandion.child import GRACE_S, UNFLOWN_GRACE_S, Child, Event
from pandion.display import Display
from pandion.process_faults import ProcessFaults
from pandion.processor import ANYWHERE, Places

_LISTEN_S: Final = 30.0  # until sitl has bound its port
_FOLLOW_S: Final = 3.0  # one process ends this soon after the other
_STALLED_S: Final = 0.08  # the same for a process that is silent: it has had its time


class ProcessFailed(Exception):
    """A process could not start, in one sentence."""

    def __init__(self, sentence: str, exit_code: int = COULD_NOT_START) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code


@dataclass(slots=True)
class Flown:
    """What the two processes reported."""

    results: dict[str, dict[str, Any]] = field(default_factory=dict)  # by process
    errors: dict[str, str] = field(default_factory=dict)  # by process
    aftermath: list[str] = field(default_factory=list)  # what went wrong after the flight
    unwritten: list[str] = field(default_factory=list)  # results that did not get to the disk
    port: int | None = None
    duration_s: float = 1.0
    started: bool = False
    interrupted: bool = False

    @property
    def sitl(self) -> dict[str, Any] | None:
        """The simulator's result; None if it did not get to write one."""
        return self.results.get("sitl")

    @property
    def fsw(self) -> dict[str, Any] | None:
        """The flight software's result; None if it did not get to write one."""
        return self.results.get("fsw")

    @property
    def cause(self) -> str | None:
        """Why the processes ended by themselves, in one sentence; None without an error."""
        return "; ".join(self.errors.values()) or None

    @property
    def failure(self) -> str | None:
        """Everything that went wrong, None if nothing did."""
        return "; ".join((*self.errors.values(), *self.aftermath)) or None


class Supervisor:
    """Starts sitl, then fsw, and waits for both to end."""

    def __init__(
        self,
        display: Display,
        out: Path,
        places: Places = ANYWHERE,
        runner: str | None = None,
        found: Callable[[int], None] | None = None,
    ) -> None:
        """``found`` is told the port at which the flight software hears ground stations."""
        self._found = found
        self._display = display
        self._places = places
        self._runner = runner
        self._out = out
        self._flown = Flown()
        self._children: list[Child] = []
        self._faults = ProcessFaults()
        self._compiling = CompileProgress()
        self._selector = selectors.DefaultSelector()

    def run(self, sitl: list[str], fsw: Callable[[int], list[str]]) -> Flown:
        """Run one flight of both command lines, the flight software's given the simulator's port.

        Raises:
            ProcessFailed: The flight did not begin.
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
                with self._display.progress():
                    self._watch(lambda: False)
        finally:
            self._faults.end()
            for child in self._children:
                child.interrupt()
            for child in self._children:
                child.end(patience_s=1.0)
            self._selector.close()
            for number, handler in previous.items():
                signal.signal(number, handler)
        if self._flown.started:
            return self._flown
        if self._flown.interrupted:
            raise ProcessFailed("interrupted before the flight began", exit_code=1)
        raise ProcessFailed(self._flown.failure or "the simulator did not start")

    def _start(self, name: str, arguments: list[str], processor: int | None) -> None:
        child = Child(name, arguments, self._log(name), processor, self._runner)
        self._children.append(child)
        self._selector.register(child, selectors.EVENT_READ)

    def _watch(self, done: Callable[[], bool], patience_s: float = math.inf) -> None:
        """Take in events until ``done``, both processes have ended or the patience is over."""
        until_s = time.monotonic() + patience_s
        while self._selector.get_map() and not done() and time.monotonic() <= until_s:
            for key, _ in self._selector.select(timeout=self._timeout_s()):
                child = key.fileobj
                assert isinstance(child, Child)
                events = child.events()
                if events is None:
                    self._selector.unregister(child)
                    self._note_exit(child)
                for event in events or ():
                    self._handle(child, event)
            self._faults.go_on()
            if (seen := self._compiling.look()) is not None:
                self._display.report("compiling", *seen, timed=True)
            for child in self._children:
                child.escalate()

    def _timeout_s(self) -> float:
        """Until the next process is due to end [s]."""
        due_s = [child.due_s for child in self._children if child.due_s is not None]
        until_s = max(min(due_s, default=math.inf) - time.monotonic(), 0.0)
        return min(until_s, self._faults.patience_s, 0.1)

    def _others(self, child: Child) -> list[Child]:
        return [other for other in self._children if other is not child]

    def _handle(self, child: Child, event: Event) -> None:
        kind, flown = event["event"], self._flown
        if kind == "progress":
            self._display.flying(
                event["t_s"], flown.duration_s, event["min_margin_m"], event["real_time_factor"]
            )
        elif kind == "error":
            self._note_error(child, event)
        elif kind in ("listening", "compiling", "flying"):
            self._note_start(event)
        elif kind == "ended":
            self._note_result(child, event)
        elif kind == "unwritten":
            flown.unwritten.append(event["what"])
        elif kind == "fault":
            self._faults.begin(event, self._children)
        elif kind == "links" and self._found is not None:
            ports = event["ports"]
            if ports:  # the ground station's, or the programs' where that one has no UDP
                self._found(ports.get("gcs") or ports["api"])
            else:
                self._display.say("note: no page, which needs a link with UDP")
        if kind in (
            "listening",
            "preparing",
            "compiling",
            "warning",
            "parameters",
            "fault",
            "text",
        ):
            self._display.say(event["message"])

    def _note_start(self, event: Event) -> None:
        """Take in how far a process is on its way to the flight."""
        flown = self._flown
        if event["event"] == "listening":
            endless = event["duration_s"] is None  # JSON knows no infinity
            flown.port = event["port"]
            flown.duration_s = math.inf if endless else event["duration_s"]
        elif event["event"] == "flying":
            flown.started = True
            self._compiling.end()
        elif event["folder"] is not None:
            self._compiling.add(Path(event["folder"]), event["kernels"])

    def _note_error(self, child: Child, event: Event) -> None:
        """Keep the reason; before the flight, what an interrupted process says is none."""
        if self._flown.started or not child.interrupted:
            self._flown.errors[child.name] = event["message"]

    def _note_result(self, child: Child, event: Event) -> None:
        """Keep the result; a process that ends because the other is silent does not wait for it."""
        self._flown.results[child.name] = event["result"]
        silent = event.get("vehicle_silent") or event.get("ending") == "link lost"
        if silent and child.name == "fsw":
            self._flown.errors["fsw"] = event["message"]
        child.expect(_FOLLOW_S)
        for other in self._others(child) if silent else ():
            other.expect(_STALLED_S, _STALLED_S)

    def _note_exit(self, child: Child) -> None:
        """Record a crash, and wait briefly for the other process."""
        child.end(patience_s=1.0)
        code, name, flown = child.exit_code, child.name, self._flown
        obeyed = child.interrupted and code == -signal.SIGINT
        if child.killed:
            flown.aftermath.append(f"{name} did not end by itself and had to be killed")
        elif code not in (0, 1, 2) and not obeyed and name not in flown.errors:
            flown.errors[name] = f"{name} ended with code {code}; see {self._log(name)}"
        elif flown.started and name not in flown.errors and name not in flown.results:
            flown.errors[name] = f"{name} ended without a result; see {self._log(name)}"
        # Before the flight there is no link whose silence the other process would notice.
        for other in self._others(child):
            other.expect(_FOLLOW_S if flown.started else 0.0, self._grace_s)

    @property
    def _grace_s(self) -> float:
        """Between an interrupt and the kill [s]."""
        return GRACE_S if self._flown.started else UNFLOWN_GRACE_S

    def _log(self, name: str) -> Path:
        return self._out / f"{name}.log"

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        """End the simulator, which ends the flight software and still gives a result."""
        self._flown.interrupted = True
        for child in self._children:
            child.expect(GRACE_S, self._grace_s)
        for child in self._children[:1]:
            child.interrupt()
