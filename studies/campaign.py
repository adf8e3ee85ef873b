"""Many flights: a pool of processes, a journal to resume from, progress while it runs.

Each process computes with one thread, so that as many run as there are cores. A flight that
raises is a row; a process that dies takes the pool with it, so the flights that were out are
flown again in a new pool, and one that kills its pool twice is a row as well.
"""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path

from studies.job import Job, Outcome, broken, outcome
from studies.one_thread import pin_threads

Report = Callable[[int, int], None]  # flights done, flights in all

_POOLS = 3  # attempts at flights whose process died


def silent(done: int, total: int) -> None:
    """Report nothing."""


@dataclass
class Campaign:
    """Flies jobs, each distinct one once."""

    workers: int = 1  # 0: in this process
    journal: Path | None = None  # JSON lines; what is in it is not flown again
    report: Report = silent
    _known: dict[str, Outcome] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.journal is not None and self.journal.exists():
            self._known.update(_read(self.journal))

    def fly(self, jobs: list[Job]) -> list[Outcome]:
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
        left = dict(jobs)
        for _ in range(_POOLS):
            for key, row in self._pooled(left):
                del left[key]
                yield key, row
            if not left:
                return
        for key, job in left.items():
            yield key, broken(job, "the process that flew it died")

    def _pooled(self, jobs: dict[str, Job]) -> Iterator[tuple[str, Outcome]]:
        """What one pool can fly; ends early if a process dies."""
        pin_threads()  # inherited by the processes, before they load their libraries
        spawn = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(self.workers, mp_context=spawn)
        out: dict[Future[Outcome], str] = {}
        try:
            out = {pool.submit(outcome, job): key for key, job in jobs.items()}
            for future in as_completed(out):
                yield out[future], future.result()
        except BrokenProcessPool:
            return
        finally:
            pool.shutdown(wait=True, cancel_futures=True)

    def _keep(self, key: str, row: Outcome) -> None:
        self._known[key] = row
        if self.journal is not None and not row.error:
            self.journal.parent.mkdir(parents=True, exist_ok=True)
            with self.journal.open("a", encoding="utf-8") as lines:
                # A line of its own even after one that an interrupt cut short.
                lines.write("\n" + json.dumps({"key": key, **row.as_json()}) + "\n")


def _read(journal: Path) -> dict[str, Outcome]:
    """Rows of a journal; empty lines and one cut short by an interrupt are dropped."""
    known = {}
    for line in journal.read_text(encoding="utf-8").splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        key = row.pop("key")
        known[key] = Outcome(**row)
    return known
