"""Campaigns: each flight once, resumable, and what goes wrong is a row."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from studies.campaign import worker
from studies.campaign.campaign import Campaign
from studies.campaign.identity import Identity, identity
from studies.campaign.worker import fly_one
from tests.studies.campaign.stub_flights import StubFlight, StubRow, noted


def test_equal_flights_are_flown_once_and_answered_each(tmp_path: Path) -> None:
    note = tmp_path / "note"
    received: list[tuple[int, int]] = []
    campaign = Campaign[StubRow](0, report=lambda done, total: received.append((done, total)))
    rows = campaign.run([StubFlight(number, note=note) for number in (1, 2, 1)])
    assert noted(note) == ["flies 1", "flies 2"]
    assert [row.number for row in rows] == [1, 2, 1]
    assert received == [(0, 2), (1, 2), (2, 2)]


def test_a_journal_resumes_and_survives_a_line_cut_short(tmp_path: Path) -> None:
    journal, note = tmp_path / "journal.jsonl", tmp_path / "note"
    flights = [StubFlight(number, note=note) for number in (1, 2, 3)]
    first = Campaign[StubRow](0, journal).run(flights[:1])
    with journal.open("a") as lines:
        lines.write('{"key": "cut sh')
    rows = Campaign[StubRow](0, journal).run(flights)
    assert rows[0] == first[0]
    assert Campaign[StubRow](0, journal).run(flights) == rows
    assert noted(note) == ["flies 1", "flies 2", "flies 3"]


def test_a_flight_that_raises_is_tried_three_times_and_again_on_resuming(tmp_path: Path) -> None:
    journal, note = tmp_path / "journal.jsonl", tmp_path / "note"
    flights = [StubFlight(1, "raises", note), StubFlight(2, note=note)]
    bad, good = Campaign[StubRow](0, journal).run(flights)
    assert bad == StubRow(1, "ValueError: no such wind", error=True)
    assert not good.error
    assert noted(note) == ["raises 1"] * 3 + ["flies 2"]
    Campaign[StubRow](0, journal).run(flights)
    assert noted(note)[4:] == ["raises 1"] * 3


def test_a_flight_that_hangs_is_ended_and_the_next_is_flown() -> None:
    began_s = time.monotonic()
    row = fly_one(StubFlight(1, "hangs"), 0.1, hard=False)
    assert row == StubRow(1, "it took longer than 0.1 s", error=True)
    assert time.monotonic() - began_s < 5.0
    assert fly_one(StubFlight(2), 0.1, hard=False) == StubRow(2)


def test_workers_of_another_version_are_refused_and_told_why() -> None:
    here = identity()
    assert here.differs(here) == ""
    other = Identity("0" * 32, here.packages, here.threads)
    assert here.differs(other) == f"code {'0' * 15} instead of {here.code[:15]}"
    refused, rows, _ = worker.fly_packed("0" * 32, here.packages, b"", 1.0)
    assert refused.startswith("code ")
    assert rows == b""


@pytest.mark.long
def test_flights_are_flown_by_other_processes_here(tmp_path: Path) -> None:
    note, journal = tmp_path / "note", tmp_path / "journal.jsonl"
    flights = [StubFlight(number, note=note) for number in range(30)]
    flights.append(StubFlight(30, "raises", note))
    with Campaign[StubRow](1, journal) as campaign:
        rows = campaign.run(flights)
        again = campaign.run([*flights[5:], StubFlight(31, note=note)])
    assert [row.number for row in rows] == list(range(31))
    assert [row.number for row in rows if row.error] == [30]
    assert [row.number for row in again] == [*range(5, 31), 31]
    assert sorted(noted(note)) == sorted(
        [one.key() for one in flights[:30]] + ["raises 30"] * 6 + ["flies 31"]
    )
    assert len(journal.read_text().splitlines()) == 33


def test_a_disk_that_is_full_does_not_keep_processes_running(tmp_path: Path) -> None:
    closed: list[bool] = []

    class Cluster:
        def close(self, *, at_once: bool) -> None:
            closed.append(at_once)

    class FullDisk:
        def close(self) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

    campaign = Campaign[StubRow](1, tmp_path / "journal.jsonl")
    campaign._cluster, campaign._lines = Cluster(), FullDisk()  # type: ignore[assignment]
    with pytest.raises(OSError, match="No space left"):
        campaign.close(at_once=True)
    assert closed == [True]
    campaign.close()


@pytest.mark.long
@pytest.mark.parametrize("ending", ["Ctrl-C", "a batch system's SIGTERM"])
def test_an_interrupt_ends_the_campaign_and_its_processes_at_once(
    ending: str, tmp_path: Path
) -> None:
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
        if ending == "Ctrl-C":
            os.killpg(process.pid, signal.SIGINT)  # to all processes, as a terminal does
        else:
            process.terminate()
        reported, _ = process.communicate(timeout=20.0)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 1
    assert f"--out {tmp_path} resumes" in reported
    assert "resource_tracker" not in reported
