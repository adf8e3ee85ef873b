"""Workers of Dask: this machine's, or those of a scheduler that runs already."""

from __future__ import annotations

import contextlib
import importlib.util
import itertools
import logging
import os
import pickle
import queue
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

import dask
from distributed import Client, Future, KilledWorker, LocalCluster, Security

from fsw.runtime.process import pin_numerics_to_one_thread
from studies.campaign.dispatch import Came
from studies.campaign.identity import identity
from studies.campaign.ports import Scheduler, SchedulerGoneError
from studies.flight.kernels import compile_first

GIVE_UP_S: Final = 600.0  # without a scheduler
_HERE: Final = "127.0.0.1"
_LOOK_S: Final = 1.0  # between looks at who is there
_PATIENCE_S: Final = 10.0  # without a worker, before that is said
_CONNECT_S: Final = 5.0
_CLOSE_S: Final = 5.0
_SETTINGS: Final = {
    "distributed.worker.profile.enabled": False,  # it stops a flight a hundred times a second
    "distributed.diagnostics.nvml": False,
    # A worker that takes longer than this to start again is given up; on a busy machine, 15 s pass.
    "distributed.deploy.lost-worker-timeout": "24h",
    "distributed.admin.event-loop": "tornado",
}


@dataclass
class _Out:
    future: Future
    only: frozenset[str] = field(default_factory=frozenset)  # workers that may; empty: all


class _Client(Client):  # type: ignore[misc]
    """Is closed by its owner; one that could not connect does not wait for itself when it goes."""

    def __del__(self) -> None:
        pass


class Cluster:
    """Takes tasks of pickled flights; what came of them waits until it is asked for."""

    def __init__(
        self, workers: int, scheduler: Scheduler | None, say: Callable[[str], None]
    ) -> None:
        """Start workers on this machine, or connect to a scheduler.

        Raises:
            SchedulerGoneError: It does not answer.
        """
        self._scheduler, self._say = scheduler, say
        self._numbers = itertools.count()
        self._name = os.urandom(6).hex()  # of this client's tasks
        self._came: queue.SimpleQueue[tuple[int, Future]] = queue.SimpleQueue()
        self._out: dict[int, _Out] = {}
        self._fly = _carrier()  # one object, which Dask serialises once
        self._refused: dict[str, str] = {}
        self._workers: dict[str, int] = {}
        self._looked_s, self._none_since_s = -1e9, time.monotonic()
        _quiet()
        dask.config.set(_SETTINGS)
        self._local = _local(workers, say) if scheduler is None else None
        try:
            self._client = self._connected(first=True)
        except BaseException:
            self._end_local(at_once=True)
            raise
        self.look()
        if self.dashboard:
            say(f"dashboard {self.dashboard}")

    @property
    def dashboard(self) -> str:
        """Where Dask's pages of the cluster are; empty if its server is not there."""
        return str(self._client.dashboard_link) if _has_bokeh() else ""

    @property
    def threads(self) -> int:
        """Flights that can be flown at once."""
        return sum(n for one, n in self._workers.items() if one not in self._refused)

    def submit(self, batches: Sequence[Sequence[Any]], limit_s: float) -> list[int]:
        """Give each batch of flights to a worker as a task; the numbers of the tasks."""
        tasks = [next(self._numbers) for _ in batches]
        only = self._fit() if self._refused else frozenset()
        own = identity()
        futures = self._client.map(
            self._fly,
            [pickle.dumps(tuple(flights)) for flights in batches],
            key=[f"flights-{self._name}-{task}" for task in tasks],
            pure=False,
            workers=sorted(only) or None,
            allow_other_workers=False,
            code=own.code,
            packages=own.packages,
            limit_s=limit_s,
        )
        for task, future in zip(tasks, futures, strict=True):
            self._out[task] = _Out(future, only)
            future.add_done_callback(partial(self._put, task))
        return tasks

    def _put(self, task: int, future: Future) -> None:
        self._came.put((task, future))

    def came(self, wait_s: float) -> list[Came]:
        """What came since, after at most ``wait_s`` [s]; a task that was lost is in it."""
        self.look()
        found = self._stranded()
        done: dict[int, Future] = {}
        with contextlib.suppress(queue.Empty):
            task, future = self._came.get(timeout=0.0 if found else wait_s)
            while True:
                if task in self._out:
                    done[task] = future
                task, future = self._came.get_nowait()
        if any(future.status in ("cancelled", "lost") for future in done.values()):
            return found + self._lost_all()
        found += self._answers(done)
        for one in found:
            self._out.pop(one.task, None)
        if any(one.broke for one in found):
            self.look(now=True)  # a campaign that ends within the second says it too
        return found

    def look(self, *, now: bool = False) -> None:
        """See which workers there are: once a second, or ``now``."""
        now_s = time.monotonic()
        if not now and now_s < self._looked_s + _LOOK_S:
            return
        self._looked_s = now_s
        before = set(self._workers)
        with contextlib.suppress(OSError, TimeoutError):
            self._workers = dict(self._client.nthreads())
        for gone in sorted(before - set(self._workers)):
            self._say(f"worker {gone} is gone; the flights that it had are flown again")
        if self.threads:
            self._none_since_s = now_s
        elif now_s > self._none_since_s + _PATIENCE_S:
            self._none_since_s = now_s + _PATIENCE_S
            self._say("no worker is there that can fly; waiting for one")

    def close(self, *, at_once: bool = False) -> None:
        """End workers of ours, forget tasks of others."""
        futures = [one.future for one in self._out.values()]
        self._out.clear()
        with contextlib.suppress(Exception):
            if futures and self._scheduler is not None:
                self._client.cancel(futures)
        if at_once and self._local is not None:
            self._kill()
        with contextlib.suppress(Exception):
            self._client.close(_CLOSE_S)
        self._end_local(at_once=at_once)

    def _refuse(self, worker: str, why: str) -> None:
        """Give a worker no more flights."""
        if worker not in self._refused:
            self._refused[worker] = why
            self._say(f"worker {worker} is refused: it has {why}; set up the same version there")

    def _fit(self) -> frozenset[str]:
        return frozenset(one for one in self._workers if one not in self._refused) or frozenset(
            ("tcp://127.0.0.1:1",)  # nobody: until one comes
        )

    def _stranded(self) -> list[Came]:
        """Tasks that only workers may fly that are not there any more."""
        found = [
            task
            for task, out in self._out.items()
            if out.only and not out.only & set(self._workers)
        ]
        if found and any(one not in self._refused for one in self._workers):
            futures = [self._out.pop(task).future for task in found]
            with contextlib.suppress(Exception):
                self._client.cancel(futures)
            return [Came(task) for task in found]
        return []

    def _answers(self, done: dict[int, Future]) -> list[Came]:
        good = {task: one for task, one in done.items() if one.status == "finished"}
        found = [Came(task, broke=_why(one)) for task, one in done.items() if task not in good]
        if good:
            try:
                answers = self._client.gather(list(good.values()), errors="raise")
            except Exception:  # a worker died with its answer: it is computed again
                return found + [Came(task) for task in good]
            found += [self._read(*pair) for pair in zip(good, answers, strict=True)]
        return found

    def _read(self, task: int, answer: tuple[str, str, bytes, float]) -> Came:
        worker, refused, rows, took_s = answer
        if refused:
            self._refuse(worker, refused)
            return Came(task)
        return Came(task, pickle.loads(rows), took_s)

    def _lost_all(self) -> list[Came]:
        """The scheduler is gone, and with it all tasks; wait for the next one."""
        lost = [Came(task) for task in self._out]
        self._out.clear()
        self._say("the connection to the scheduler is lost; waiting for it")
        with contextlib.suppress(Exception):
            self._client.close(0.5)
        self._client = self._connected(first=False)
        self._refused.clear()
        self._looked_s = -1e9
        self.look()
        self._say("the scheduler is back")
        return lost

    def _connected(self, *, first: bool) -> Client:
        began_s = time.monotonic()
        while True:
            try:
                return _Client(**self._where(), timeout=_CONNECT_S, set_as_default=False)
            except Exception as error:  # whatever listens there may answer anything
                if first or time.monotonic() > began_s + GIVE_UP_S:
                    raise SchedulerGoneError(self._no_answer(error)) from None
                time.sleep(0.5)

    def _where(self) -> dict[str, Any]:
        scheduler = self._scheduler
        if scheduler is None:
            return {"address": self._local}
        where: dict[str, Any] = (
            {"scheduler_file": str(scheduler.file)}
            if scheduler.file is not None
            else {"address": scheduler.address}
        )
        if scheduler.tls_ca_file is not None:
            where["security"] = Security(
                tls_ca_file=str(scheduler.tls_ca_file),
                tls_client_cert=None if scheduler.tls_cert is None else str(scheduler.tls_cert),
                tls_client_key=None if scheduler.tls_key is None else str(scheduler.tls_key),
                require_encryption=True,
            )
        return where

    def _no_answer(self, error: Exception) -> str:
        scheduler = self._scheduler
        assert scheduler is not None, error
        where = scheduler.address or scheduler.file
        if str(where).startswith("tls://") and scheduler.tls_ca_file is None:
            return f"{where} needs --tls-ca-file, --tls-cert and --tls-key ({error})"
        return (
            f"no scheduler answers at {where} ({type(error).__name__}); start one with "
            "`dask scheduler`, or leave it out to fly on this machine"
        )

    def _kill(self) -> None:
        """End the processes in the middle of their flights, and let none be started anew."""
        for nanny in self._local.workers.values():  # type: ignore[union-attr]
            nanny.auto_restart = False
            with contextlib.suppress(AttributeError, TypeError, ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)

    def _end_local(self, *, at_once: bool) -> None:
        if self._local is not None:
            with contextlib.suppress(Exception):
                self._local.close(_CLOSE_S)


def _local(workers: int, say: Callable[[str], None]) -> LocalCluster:
    """Processes of one thread each, which nothing outside this machine can reach."""
    compile_first(say)
    pin_numerics_to_one_thread()  # inherited by the processes, before they load their libraries
    return LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host=_HERE,
        dashboard_address=f"{_HERE}:0",
        silence_logs=logging.CRITICAL,
        memory_limit=0,
        preload=["studies.campaign.worker"],
        scheduler_kwargs={"allowed_failures": 0},
        death_timeout=60,
    )


def _quiet() -> None:
    """Say in our own words what happens: Dask prints tracebacks."""
    for name in ("distributed", *logging.root.manager.loggerDict):
        if name.startswith("distributed"):
            logging.getLogger(name).setLevel(logging.CRITICAL)


def _has_bokeh() -> bool:
    return importlib.util.find_spec("bokeh") is not None


def _why(future: Future) -> str:
    error = future.exception()
    if isinstance(error, KilledWorker):
        return "the process that flew it died"
    return f"{type(error).__name__}: {error}"


def _carrier() -> Callable[..., Any]:
    """A task that is sent as it is written: a worker may have other code, or none of ours."""

    def fly(packed: bytes, code: str, packages: str, limit_s: float) -> Any:
        from distributed import get_worker

        worker = get_worker().address
        try:
            from studies.campaign.worker import fly_packed
        except ImportError as error:
            return worker, f"no such code ({error})", b"", 0.0
        return (worker, *fly_packed(code, packages, packed, limit_s))

    return fly
