"""Run pytest again and again in forks of one process that has the libraries loaded.

Reads one JSON request a line: ``tests`` (pytest's arguments), ``deselect`` (test ids), ``timeout``
[s] for the whole run, ``each`` [s] for every test or null, ``stop`` (at the first failure). Answers
one JSON object a line: ``failed`` (test ids), ``seconds`` (of each id), ``status``. Times are the
processor's, which other work on the machine does not lengthen. Runs in the environment
of the tests, in the copy; nothing of the copy is loaded before a fork.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import math
import os
import resource
import select
import signal
import sys
import time
from pathlib import Path
from typing import Any

for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[threads] = "1"
os.environ["MAVLINK20"] = "1"  # see tests/conftest.py

import hypothesis  # noqa: E402
import pytest  # noqa: E402

# A mutant and the one before it may have the same size and time: no byte code is kept.
sys.dont_write_bytecode = True
for library in (
    "clarabel",
    "hypothesis.extra.numpy",
    "hypothesis.strategies",
    "numpy",
    "scipy.integrate",
    "scipy.linalg",
    "scipy.optimize",
    "scipy.spatial.transform",
):
    with contextlib.suppress(ImportError):
        __import__(library)


_WAITING = 10  # times the limit of a run may pass on the clock: the machine is busy, or it hangs
_PR_SET_PDEATHSIG = 1  # prctl(2): a stopped run stops its current test


class _Recorder:
    """A pytest plugin: what failed, and how long each test took."""

    def __init__(self, each: float | None) -> None:
        self.failed: list[str] = []
        self.seconds: dict[str, float] = {}
        self._each = each

    def pytest_sessionstart(self) -> None:
        # A test that fails has done its work: it need not look for a smaller example.
        phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
        hypothesis.settings.register_profile("mutation", phases=phases, database=None)
        hypothesis.settings.load_profile("mutation")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        begin = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, self._each or 0.0)
        try:
            return (yield)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            self.seconds[item.nodeid] = time.process_time() - begin

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and report.nodeid not in self.failed:
            self.failed.append(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.failed.append(report.nodeid)


def _too_slow(_number: int, _frame: Any) -> None:
    pytest.fail("takes too long in plain Python")


def _child(request: dict[str, Any], answer: int) -> None:
    os.setsid()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    most = math.ceil(request["timeout"])
    resource.setrlimit(resource.RLIMIT_CPU, (most, most + 1))
    sys.path.insert(0, str(Path.cwd()))
    signal.signal(signal.SIGPROF, _too_slow)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nowhere, standard)
    recorder = _Recorder(request["each"])
    arguments = ["-q", "--no-header", "--tb=no", "-p", "no:cacheprovider", *request["tests"]]
    arguments += ["-x"] if request["stop"] else []
    arguments += [f"--deselect={test}" for test in request["deselect"]]
    status = int(pytest.main(arguments, plugins=[recorder]))
    answered = {"status": status, "failed": recorder.failed, "seconds": recorder.seconds}
    with os.fdopen(answer, "w") as pipe:
        json.dump(answered, pipe)


def _run(request: dict[str, Any]) -> dict[str, Any]:
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(reading)
            _child(request, writing)
        finally:
            os._exit(0)
    os.close(writing)
    text = b""
    end = time.monotonic() + _WAITING * request["timeout"]
    timed_out = False
    with os.fdopen(reading, "rb") as pipe:
        while True:
            left = end - time.monotonic()
            ready, _, _ = select.select([pipe], [], [], max(left, 0.0))
            if not ready:
                timed_out = True
                break
            chunk = os.read(pipe.fileno(), 65536)
            if not chunk:
                break
            text += chunk
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    if timed_out:
        return {"status": -1, "failed": ["timeout"], "seconds": {}}
    return json.loads(text) if text else {"status": -2, "failed": ["crash"], "seconds": {}}


def main() -> None:
    for line in sys.stdin:
        print(json.dumps(_run(json.loads(line))), flush=True)


main()
