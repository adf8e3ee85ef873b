"""What a flight costs the machine, read from /proc while it flies: memory, and who else is busy."""

from __future__ import annotations

import contextlib
import os
import resource
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from benchmarks.budgets import MachineNoise
from command_line.version import version

_GLANCE_S: Final = 1.0
_VERB: Final = b"\0fsw\0"  # of ``pandion``, in the words that start it
_SETTLED_S: Final = 5.0  # from here on memory may not grow
_PAGE: Final = os.sysconf("SC_PAGE_SIZE")
_TICK_S: Final = 1.0 / os.sysconf("SC_CLK_TCK")


def version_and_machine() -> str:
    """The first line of a measurement."""
    return f"Pandion {version()}: {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"


@dataclass(slots=True)
class Watch:
    """Watches the flight software among the descendants of this process, in a thread."""

    flying: Callable[[], bool]  # compiling, which comes before, is not what is watched
    resident: list[tuple[float, int]] = field(default_factory=list)  # seconds, bytes
    children_bytes: int = 0  # what its children have for themselves
    noise: MachineNoise | None = None
    _done: threading.Event = field(default_factory=threading.Event)
    _thread: threading.Thread | None = None
    _begin: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def __enter__(self) -> Watch:
        self._begin = _busy()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        assert self._thread is not None
        self._thread.join()
        wall, busy, stolen, ours = (b - a for a, b in zip(self._begin, _busy(), strict=True))
        cores = os.cpu_count() or 1
        self.noise = MachineNoise(max(busy - ours, 0.0) / wall, stolen / (wall * cores))

    @property
    def resident_mb(self) -> float | None:
        """Most that was resident: the process, and what its children do not share with it."""
        if not self.resident:
            return None
        return (max(size for _, size in self.resident) + self.children_bytes) / 1e6

    @property
    def growth_mb(self) -> float | None:
        """From the fifth second to the end; None for a flight too short to say."""
        settled = [size for seconds, size in self.resident if seconds >= _SETTLED_S]
        return (settled[-1] - settled[0]) / 1e6 if len(settled) >= 2 else None

    def _look(self) -> None:
        begin: float | None = None
        while not self._done.wait(_GLANCE_S):
            process = self._find(os.getpid()) if self.flying() else None
            if process is None:
                continue
            with contextlib.suppress(OSError, ValueError, IndexError):
                begin = time.monotonic() if begin is None else begin
                pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
                seconds = time.monotonic() - begin
                self.resident.append((seconds, pages * _PAGE))
                if self.children_bytes == 0 and seconds >= _SETTLED_S:
                    # Once only: it walks all pages of the process it asks about.
                    self.children_bytes = sum(_private(child) for child in descendants(process))

    def _find(self, root: int) -> int | None:
        for process in descendants(root):
            with contextlib.suppress(OSError):
                if _VERB in Path(f"/proc/{process}/cmdline").read_bytes():
                    return process
        return None


def descendants(root: int) -> list[int]:
    """Processes below a process: children first, then theirs."""
    found: list[int] = []
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{root}/task").iterdir():
            found += [int(number) for number in (task / "children").read_text().split()]
    return found + [below for child in found for below in descendants(child)]


def _private(process: int) -> int:
    """Bytes resident in a process and in no other."""
    with contextlib.suppress(OSError):
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
        return 1024 * sum(int(line.split()[1]) for line in lines if line.startswith("Private_"))
    return 0


def _busy() -> tuple[float, float, float, float]:
    """Wall time, busy and stolen time of all processors, and what of it was ours [s]."""
    fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    user, nice, system, _, _, interrupts, soft, stolen = (int(value) for value in fields[:8])
    ours = 0.0
    for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN):
        usage = resource.getrusage(who)
        ours += usage.ru_utime + usage.ru_stime
    busy = (user + nice + system + interrupts + soft) * _TICK_S
    return time.monotonic(), busy, stolen * _TICK_S, ours
