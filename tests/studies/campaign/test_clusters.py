"""Workers that die, schedulers that come back, machines with other code: rows stay the same."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from studies.campaign.campaign import Campaign
from studies.campaign.ports import Scheduler, SchedulerGoneError
from studies.campaign.store import read
from tests.studies.campaign.stub_flights import StubFlight, StubRow, noted
from tests.waiting import wait_for

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[3]
DASK = Path(sys.executable).parent / "dask"
SMALL = """
flights = 16
duration_s = 1.0
seed = 3
scenarios = ["walls", "workspace"]
suites = ["perfect", "mocap"]
[vary]
vehicle_scale.mass = { uniform = [0.95, 1.05] }
vehicle_scale.inertia = { uniform = [0.95, 1.05] }
latency_ms = { choice = [0.0, 2.0, 4.0] }
wind_m_s2 = { uniform = [0.0, 0.2] }
"""


class DaskByHand:
    """A scheduler and workers, each in a process of its own, as a user starts them."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        self.port = 0
        self.processes: list[subprocess.Popen[bytes]] = []

    def scheduler(self) -> subprocess.Popen[bytes]:
        self.file.unlink(missing_ok=True)
        process = self._start("scheduler", f"--port={self.port}", "--no-dashboard")
        wait_for(self._written, "the scheduler's file", 60.0)
        return process

    def worker(self, **environment: str) -> subprocess.Popen[bytes]:
        return self._start("worker", "--nthreads=1", "--no-dashboard", **environment)

    def end(self) -> None:
        for process in self.processes:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()

    def _written(self) -> bool:
        with contextlib.suppress(OSError, ValueError, KeyError):
            self.port = int(json.loads(self.file.read_text())["address"].rpartition(":")[2])
            return True
        return False

    def _start(self, what: str, *words: str, **environment: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [DASK, what, "--host=127.0.0.1", f"--scheduler-file={self.file}", *words],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | environment,
            cwd=self.file.parent,
            start_new_session=True,
        )
        self.processes.append(process)
        return process


@pytest.fixture
def by_hand(tmp_path: Path) -> Iterator[DaskByHand]:
    dask = DaskByHand(tmp_path)
    yield dask
    dask.end()


def pandion(*words: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "pandion", "campaign", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def finished(process: subprocess.Popen[str]) -> str:
    said, _ = process.communicate(timeout=600.0)
    assert process.returncode == 0, said
    return said


def rows_of(out: Path) -> list[dict[str, object]]:
    return [row.compared() for row in read(out).rows]


def test_rows_are_the_same_however_they_are_flown(tmp_path: Path, by_hand: DaskByHand) -> None:
    file = tmp_path / "small.toml"
    file.write_text(SMALL)
    outs = {how: tmp_path / how for how in ("serial", "one", "two", "hand")}
    finished(pandion(file, "--workers=0", f"--out={outs['serial']}"))
    finished(pandion(file, "--workers=1", f"--out={outs['one']}"))
    finished(pandion(file, "--workers=2", f"--out={outs['two']}"))
    by_hand.scheduler()
    workers = [by_hand.worker(), by_hand.worker()]
    finished(pandion(file, f"--scheduler-file={by_hand.file}", f"--out={outs['hand']}"))
    assert all(worker.poll() is None for worker in workers)
    serial = rows_of(outs["serial"])
    assert len(serial) == 16
    assert not any(row["error"] for row in serial)
    tables = {how: (out / "rows.parquet").read_bytes() for how, out in outs.items()}
    for how, out in outs.items():
        assert rows_of(out) == serial, how
        assert tables[how] == tables["serial"], how


def test_an_interrupted_campaign_with_a_killed_worker_goes_on(tmp_path: Path) -> None:
    file, out = tmp_path / "small.toml", tmp_path / "out"
    file.write_text(SMALL.replace("= 16", "= 60"))
    process = pandion(file, "--workers=2", f"--out={out}")
    journal = out / "journal.jsonl"
    wait_for(lambda: len(noted(journal)) >= 4, "four rows", 300.0)
    found = subprocess.run(
        ["pgrep", "-P", str(process.pid), "-f", "spawn_main"],
        capture_output=True,
        text=True,
        check=True,
    )
    os.kill(int(found.stdout.split()[0]), signal.SIGKILL)
    wait_for(lambda: len(noted(journal)) >= 8, "eight rows", 300.0)
    os.killpg(process.pid, signal.SIGINT)
    said, _ = process.communicate(timeout=60.0)
    assert process.returncode == 1
    words = "" if os.cpu_count() == 2 else "--workers=2 "  # a default is left out
    assert f"go on with: pandion campaign {file} {words}--out {out}" in said
    kept = noted(journal)
    assert 8 <= len(kept) < 60
    finished(pandion(file, "--workers=2", f"--out={out}"))
    assert noted(journal)[: len(kept)] == kept
    assert [row["flight"] for row in rows_of(out)] == list(range(60))
    assert len(noted(journal)) == 60  # nothing twice
    finished(pandion(file, "--workers=0", f"--out={tmp_path / 'serial'}"))
    assert rows_of(out) == rows_of(tmp_path / "serial")


def test_a_flight_that_kills_its_process_is_a_row_and_the_others_are_flown() -> None:
    flights = [StubFlight(number, "kills" if number == 7 else "flies") for number in range(20)]
    said: list[str] = []
    rows = Campaign[StubRow](2, say=said.append).run(flights)
    assert any("is gone; the flights that it had are flown again" in one for one in said)
    assert [row.number for row in rows] == list(range(20))
    assert [(row.number, row.reason) for row in rows if row.error] == [
        (7, "the process that flew it died; tried 3 times")
    ]


def test_a_flight_that_python_cannot_end_costs_its_process() -> None:
    flights = [StubFlight(0, "hangs in C"), *(StubFlight(number) for number in range(1, 5))]
    rows = Campaign[StubRow](1, time_limit_s=1.0, tries=1).run(flights)
    assert [row.number for row in rows if not row.error] == [1, 2, 3, 4]
    assert rows[0].error


def test_a_scheduler_that_comes_back_gets_what_is_left(tmp_path: Path, by_hand: DaskByHand) -> None:
    note = tmp_path / "note"
    scheduler = by_hand.scheduler()
    by_hand.worker()
    flights = [StubFlight(number, note=note, lasts_s=0.05) for number in range(100)]
    said: list[str] = []

    def restart() -> None:
        wait_for(lambda: len(noted(note)) >= 20, "twenty flights", 60.0)
        scheduler.kill()
        scheduler.wait()
        by_hand.scheduler()
        by_hand.worker()

    meanwhile = threading.Thread(target=restart)
    meanwhile.start()
    where = Scheduler(file=by_hand.file)
    rows = Campaign[StubRow](0, tmp_path / "journal", scheduler=where, say=said.append).run(flights)
    meanwhile.join()
    assert [row.number for row in rows] == list(range(100))
    assert not any(row.error for row in rows)
    assert len(noted(tmp_path / "journal")) == 100
    assert any("the connection to the scheduler is lost" in one for one in said)


def test_a_worker_with_other_code_flies_nothing(tmp_path: Path, by_hand: DaskByHand) -> None:
    other = tmp_path / "other"
    for package in ("fsw", "sitl", "studies", "command_line", "tests", "messages"):
        shutil.copytree(ROOT / package, other / package, ignore=shutil.ignore_patterns("*.pyc"))
    changed = other / "studies" / "paper" / "published.py"
    changed.write_text(changed.read_text() + "\n# another version\n")
    by_hand.scheduler()
    by_hand.worker(PYTHONPATH=str(other))
    said: list[str] = []
    note = tmp_path / "note"
    flights = [StubFlight(number, note=note, lasts_s=0.05) for number in range(10)]

    def help_comes() -> None:
        wait_for(lambda: any("is refused" in one for one in said), "a refusal", 60.0)
        by_hand.worker()

    meanwhile = threading.Thread(target=help_comes)
    meanwhile.start()
    where = Scheduler(file=by_hand.file)
    rows = Campaign[StubRow](0, scheduler=where, say=said.append).run(flights)
    meanwhile.join()
    assert [row.number for row in rows] == list(range(10))
    assert len(noted(note)) == 10
    (refusal,) = [one for one in said if "is refused" in one]
    assert "it has code" in refusal
    assert "tcp://127.0.0.1:" in refusal


def test_a_worker_with_several_threads_of_algebra_flies_nothing(by_hand: DaskByHand) -> None:
    by_hand.scheduler()
    many = {f"{name}_NUM_THREADS": "4" for name in ("OMP", "OPENBLAS", "MKL")}
    by_hand._start("worker", "--nthreads=1", "--no-nanny", "--no-dashboard", **many)
    said: list[str] = []

    def help_comes() -> None:
        wait_for(lambda: any("is refused" in one for one in said), "a refusal", 60.0)
        by_hand.worker()

    meanwhile = threading.Thread(target=help_comes)
    meanwhile.start()
    where = Scheduler(file=by_hand.file)
    rows = Campaign[StubRow](0, scheduler=where, say=said.append).run([StubFlight(1)])
    meanwhile.join()
    assert not rows[0].error
    assert any("linear algebra on several threads" in one for one in said)


def test_a_scheduler_that_is_not_there_is_named() -> None:
    began_s = time.monotonic()
    with pytest.raises(SchedulerGoneError, match=r"no scheduler answers at tcp://127\.0\.0\.1:9"):
        Campaign[StubRow](0, scheduler=Scheduler("tcp://127.0.0.1:9")).run([StubFlight(1)])
    assert time.monotonic() - began_s < 30.0
