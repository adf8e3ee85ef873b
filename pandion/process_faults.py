"""Faults of a scenario that only the parent of the processes can cause: signals, a full disk.

The simulator says when each begins. How long it lasts is counted in wall time, because the
simulator may be what is stopped.
"""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pandion.child import Child, Event

_AGAIN_S: Final = 0.05  # between two looks for a planner that was started anew
_NAMES: Final = {"simulator": "sitl", "flight software": "fsw", "planner": "fsw", "disk": "fsw"}


@dataclass
class _Lasting:
    """One fault that lasts until a time on the monotonic clock [s]."""

    cause: Callable[[], None]  # again and again
    undo: Callable[[], None]
    until_s: float


class ProcessFaults:
    """Causes them on the processes of one flight."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lasting: list[_Lasting] = []

    def begin(self, fault: Event, children: Iterable[Child]) -> None:
        """Cause a ``fault``, the simulator's event with its keys, where it is one of a process."""
        name = _NAMES.get(fault["unit"])
        child = next((one for one in children if one.name == name), None)
        if child is None or child.exit_code is not None:
            return
        cause, undo = _of(fault["unit"], fault["kind"], child)
        cause()
        for_s = fault["duration_s"] or float("inf")
        self._lasting.append(_Lasting(cause, undo, self._clock() + for_s))

    def go_on(self) -> None:
        """Cause those that last again, and undo those that are over; call it now and then."""
        now_s = self._clock()
        for one in self._lasting:
            (one.cause if now_s < one.until_s else one.undo)()
        self._lasting = [one for one in self._lasting if now_s < one.until_s]

    def end(self) -> None:
        """Undo all: a process that is stopped could not end."""
        for one in self._lasting:
            one.undo()
        self._lasting.clear()

    @property
    def patience_s(self) -> float:
        """Until :meth:`go_on` is due [s]."""
        return _AGAIN_S if self._lasting else float("inf")


def planners(flight_software: int) -> list[int]:
    """Processes that plan for a flight software: its fork server's children."""
    return [worker for server in _children(flight_software) for worker in _children(server)]


def _of(unit: str, kind: str, child: Child) -> tuple[Callable[[], None], Callable[[], None]]:
    """What causes a fault of a process, and what undoes it.

    Neither does anything once the process has ended: its number may be another's by then.
    """
    if unit == "disk":
        before = resource.prlimit(child.pid, resource.RLIMIT_FSIZE)
        full = (0, before[1])
        return lambda: _limit(child, full), lambda: _limit(child, before)

    def send(number: signal.Signals) -> None:
        if child.exit_code is None:
            _signal(planners(child.pid) if unit == "planner" else [child.pid], number)

    if kind == "killed":
        return lambda: send(signal.SIGKILL), lambda: None
    return lambda: send(signal.SIGSTOP), lambda: send(signal.SIGCONT)


def _limit(child: Child, limits: tuple[int, int]) -> None:
    if child.exit_code is None:
        with contextlib.suppress(ProcessLookupError):
            resource.prlimit(child.pid, resource.RLIMIT_FSIZE, limits)


def _signal(processes: Iterable[int], number: signal.Signals) -> None:
    for process in processes:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, number)


def _children(process: int) -> list[int]:
    """Direct children of a process (Linux only)."""
    try:
        text = Path(f"/proc/{process}/task/{process}/children").read_text(encoding="ascii")
    except OSError:
        return []
    return [int(number) for number in text.split()]
