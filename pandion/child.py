"""A child process of a flight: started, listened to, and never left behind.

It is made to end in steps: it has a moment, then it is interrupted, then it is killed.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

GRACE_S: Final = 0.6  # between one way to end a process and the next, stronger one
# The same before the flight, when nobody waits for a verdict within 2 s: a busy machine takes its
# time for the end of a process that has loaded much.
UNFLOWN_GRACE_S: Final = 5.0

Event = dict[str, Any]
"""One JSON object that a child wrote on its standard output."""

_PR_SET_PDEATHSIG: Final = 1


class Child:
    """A process of the system. Its events come from its standard output, line by line."""

    def __init__(
        self,
        name: str,
        arguments: list[str],
        log: Path,
        processor: int | None = None,
        runner: str | None = None,
    ) -> None:
        """Start ``sitl`` or ``fsw`` as pandion's verbs; the standard error goes to the log.

        It may run on one processor only, any if None. A runner is a module that runs the process
        of this name in its own way.
        """
        module = [runner or "pandion", name]
        self.name = name
        self.interrupted = False  # by us
        self.killed = False  # by us
        self.due_s: float | None = None  # on the monotonic clock: when it is made to end
        self._grace_s = GRACE_S
        self._escalated = False
        self._rest = b""
        with log.open("wb") as errors:
            self._process = subprocess.Popen(
                # -P: a directory of the same name where the user stands must not be imported.
                [sys.executable, "-P", "-m", *module, *arguments, "--events", "json"],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
                preexec_fn=die_with(os.getpid(), processor),
            )
        assert self._process.stdout is not None
        self._pipe = self._process.stdout.fileno()
        os.set_blocking(self._pipe, False)

    def fileno(self) -> int:
        """The pipe of its events, for a selector."""
        return self._pipe

    def events(self) -> list[Event] | None:
        """Events that are there; None once it has closed its standard output."""
        try:
            data = os.read(self._pipe, 1 << 16)
        except BlockingIOError:
            return []
        if not data:
            return None
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [event for line in lines if (event := _event(line)) is not None]

    @property
    def pid(self) -> int:
        """Its number, which stays its own until it has been waited for."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """None while it runs; negative if a signal ended it."""
        return self._process.poll()

    def expect(self, within_s: float, grace_s: float = GRACE_S) -> None:
        """It should end within this time; of two times the earlier one counts."""
        due_s = time.monotonic() + within_s
        if self.due_s is None or due_s < self.due_s:
            self.due_s, self._grace_s = due_s, grace_s

    def escalate(self) -> None:
        """Past its time: interrupt it, and a grace later kill it."""
        now_s = time.monotonic()
        if self.due_s is None or now_s < self.due_s:
            return
        if self.exit_code is not None:
            self.due_s = None
            return
        if self._escalated:
            self.kill()
        else:
            self.interrupt()
        self._escalated = True
        self.due_s = now_s + self._grace_s

    def interrupt(self) -> None:
        """Ask it to end."""
        if self._process.poll() is None:
            self.interrupted = True
            self._process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """End it now."""
        if self._process.poll() is None:
            self.killed = True
            self._process.kill()

    def end(self, patience_s: float) -> None:
        """Wait for it, and kill it if it does not end in time."""
        try:
            self._process.wait(timeout=patience_s)
        except subprocess.TimeoutExpired:
            self.kill()
            self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()


def _event(line: bytes) -> Event | None:
    """An event, or None for a line that some library printed."""
    try:
        event = json.loads(line)  # noqa: TID251  # of our own process, or none
    except ValueError:
        return None
    return event if isinstance(event, dict) and "event" in event else None


def die_with(parent: int, processor: int | None) -> Callable[[], None] | None:
    """What a new child runs before exec, so that it ends with its parent (Linux only)."""
    if sys.platform != "linux":
        return None
    # Loaded here, because the child must not import anything between fork and exec.
    prctl = ctypes.CDLL(None).prctl

    def exit_with_parent() -> None:
        prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)
        if processor is not None:
            os.sched_setaffinity(0, {processor})

    return exit_with_parent
