"""Many flights: a pool of processes, a journal to resume from, progress while it runs.

Each process computes with one thread, so that as many run as there are cores. A flight that
raises is a row. A process that dies takes its pool with it: the flights that were out are then
flown one by one, each in a process of its own, and the one that kills it again is a row as well.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, field
from pathlib import Path

from fsw.runtime.process import pin_numerics_to_one_thread
from studies.job import Job, Outcome, broken, outcome

ProgressReport = Callable[[int, int], None]  # flights done, flights in all

_Named = tuple[str, Job]  # a flight and its key


def silent(done: int, total: int) -> None:
    """Report nothing."""


@dataclass
class Campaign:
    """Flies jobs, each distinct one once."""

    workers: int = 1  # 0: in this process
    journal: Path | None = None  # JSON lines; what is in it is not flown again
    report: ProgressReport = silent
    _known: dict[str, Outcome] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.journal is not None and self.journal.exists():
            self._known.update(_read(self.journal))

    def run(self, jobs: list[Job]) -> list[Outcome]:
        """Outcomes in the order of the jobs."""
        keys = [job.key() for job in jobs]
        missing = {key: job for key, job in zip(keys, jobs, strict=True) if key not in self._known}
        total = len(set(keys))
        done = total - len(missing)
        self.report(done, total)
        for key, row in self._flown(missing):
            self._keep(key, row)
            done += 1
            self.report(done, total)
        return [self._known[key] for key in keys]

    def _flown(self, jobs: dict[str, Job]) -> Iterator[tuple[str, Outcome]]:
        if self.workers == 0:
            for key, job in jobs.items():
                yield key, outcome(job)
            return
        waiting = deque(jobs.items())
        while waiting:
            suspects = yield from self._pooled(waiting)
            for key, job in suspects:
                yield key, _alone(job)

    def _pooled(
        self, waiting: deque[_Named]
    ) -> Generator[tuple[str, Outcome], None, tuple[_Named, ...]]:
        """Fly what waits; returns early, with the flights that were out, if a process dies."""
        pool = pool_of(self.workers)
        out: dict[Future[Outcome], _Named] = {}
        try:
            while waiting or out:
                while waiting and len(out) < self.workers:
                    out[pool.submit(outcome, waiting[0][1])] = waiting[0]
                    waiting.popleft()
                for future in wait(out, return_when=FIRST_COMPLETED).done:
                    row = future.result()
                    key, _ = out.pop(future)
                    yield key, row
        except BrokenProcessPool:
            return tuple(out.values())
        except BaseException:
            for process in multiprocessing.active_children():
                process.kill()  # or leaving would wait for flights that are no longer wanted
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
        return ()

    def _keep(self, key: str, row: Outcome) -> None:
        self._known[key] = row
        if self.journal is not None and not row.error:
            self.journal.parent.mkdir(parents=True, exist_ok=True)
            with self.journal.open("a", encoding="utf-8") as lines:
                # A line of its own even after one that an interrupt cut short.
                lines.write("\n" + json.dumps({"key": key, **asdict(row)}) + "\n")


def pool_of(workers: int) -> ProcessPoolExecutor:
    """Processes that fly jobs; SIGINT is for the one that started them."""
    pin_numerics_to_one_thread()  # inherited by the processes, before they load their libraries
    spawn = multiprocessing.get_context("spawn")
    ignored = (signal.SIGINT, signal.SIG_IGN)  # the campaign ends its processes
    return ProcessPoolExecutor(workers, spawn, initializer=signal.signal, initargs=ignored)


def _alone(job: Job) -> Outcome:
    """Fly one job in a process that nothing else depends on."""
    with pool_of(1) as pool:
        try:
            return pool.submit(outcome, job).result()
        except BrokenProcessPool:
            return broken(job, "the process that flew it died")


def _read(journal: Path) -> dict[str, Outcome]:
    """Rows of a journal; lines cut short by an interrupt or of another version are dropped."""
    known = {}
    for line in journal.read_text(encoding="utf-8").splitlines():
        with contextlib.suppress(json.JSONDecodeError, TypeError):
            row = json.loads(line)
            key = row.pop("key")
            known[key] = Outcome(**row)
    return known
