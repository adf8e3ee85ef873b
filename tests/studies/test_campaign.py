"""Campaigns: each flight once, resumable, and dead processes are rows."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import pytest

from fsw.parameters.flight_config import FlightConfig
from studies.campaign import Campaign
from studies.cases import configuration, scenario
from studies.job import Job, Outcome

FLOWN = scenario("II", disturbed=True, duration_s=0.5)
CONFIG = configuration("double-integrator")
JOBS = [Job("double-integrator", FLOWN, CONFIG, seed) for seed in (1, 2, 1)]


def test_equal_jobs_are_flown_once_and_answered_each(monkeypatch: pytest.MonkeyPatch) -> None:
    flown = []

    def count(job: Job) -> Outcome:
        flown.append(job.seed)
        return Outcome(job.seed, completed=True, reason="")

    monkeypatch.setattr(Job, "row", count)
    received: list[tuple[int, int]] = []
    rows = Campaign(0, report=lambda done, total: received.append((done, total))).run(JOBS)
    assert flown == [1, 2]
    assert [row.seed for row in rows] == [1, 2, 1]
    assert received == [(0, 2), (1, 2), (2, 2)]


def test_a_journal_resumes_and_survives_a_line_cut_short(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = tmp_path / "journal.jsonl"
    first = Campaign(0, journal).run(JOBS[:1])
    with journal.open("a") as lines:
        lines.write('{"key": "cut sh')
    flown = []

    def count(job: Job) -> Outcome:
        flown.append(job.seed)
        return Outcome(job.seed, completed=False, reason="")

    monkeypatch.setattr(Job, "row", count)
    rows = Campaign(0, journal).run(JOBS)
    assert flown == [2]
    assert rows[0] == first[0]
    assert Campaign(0, journal).run(JOBS) == rows
    assert flown == [2]


@dataclass(frozen=True)
class Deadly:
    """Ends the process that unpacks it."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os._exit, (1,)


def test_a_flight_that_kills_its_process_is_a_row_and_the_others_are_flown() -> None:
    deadly = replace(JOBS[0], config=cast(FlightConfig, Deadly()))
    dead, alive = Campaign(1).run([deadly, JOBS[1]])
    assert dead.error
    assert "died" in dead.reason
    (here,) = Campaign(0).run(JOBS[1:2])
    assert (alive.te_m, alive.margin_m, alive.ce_sum) == (here.te_m, here.margin_m, here.ce_sum)


def test_an_interrupt_ends_the_campaign_and_its_processes_at_once(tmp_path: Path) -> None:
    words = ["table4", "--plant=double-integrator", "--workers=1", f"--out={tmp_path}"]
    process = subprocess.Popen(
        [sys.executable, "-m", "pandion", "reproduce", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        while "flown 0" not in process.stdout.readline():
            assert process.poll() is None
        time.sleep(1.0)
        os.killpg(process.pid, signal.SIGINT)
        reported, _ = process.communicate(timeout=20.0)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 1
    assert f"--out {tmp_path} resumes" in reported
