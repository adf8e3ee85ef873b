"""Faults of processes: caused when the simulator says so, undone in time, and never left behind."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import pytest

from pandion.child import Child
from pandion.process_faults import ProcessFaults, planners
from tests.cli.fake_processes import event
from tests.cli.test_supervisor import SHUT_DOWN, watched
from tests.waiting import wait_for

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs /proc and prlimit")


@dataclass
class Sleeper:
    """Stands for a child of the supervisor."""

    process: subprocess.Popen[bytes]
    name: str = "fsw"

    @property
    def pid(self) -> int:
        return self.process.pid

    @property
    def exit_code(self) -> int | None:
        return self.process.poll()

    @property
    def state(self) -> str:
        """A letter of the kernel: S sleeps, T is stopped."""
        text = Path(f"/proc/{self.pid}/stat").read_text(encoding="ascii")
        return text.rpartition(")")[2].split()[0]


@pytest.fixture
def sleeper() -> Iterator[Sleeper]:
    with subprocess.Popen(["sleep", "60"]) as process:
        yield Sleeper(process)
        process.kill()


class Clock:
    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def begun(faults: ProcessFaults, sleeper: Sleeper, unit: str, kind: str, for_s: float) -> None:
    fault: dict[str, Any] = {"unit": unit, "kind": kind, "duration_s": for_s}
    faults.begin(fault, cast(list[Child], [sleeper]))


def test_a_process_is_stopped_for_its_time(sleeper: Sleeper) -> None:
    clock = Clock()
    faults = ProcessFaults(clock)
    begun(faults, sleeper, "flight software", "stopped", 2.0)
    wait_for(lambda: sleeper.state == "T" or None, "a stop")
    clock.now_s += 1.9
    faults.go_on()
    assert sleeper.state == "T"
    assert faults.patience_s < 1.0
    clock.now_s += 0.2
    faults.go_on()
    wait_for(lambda: sleeper.state == "S" or None, "its going on")
    assert faults.patience_s > 1.0


def test_the_end_of_a_flight_leaves_no_process_stopped(sleeper: Sleeper) -> None:
    faults = ProcessFaults()
    begun(faults, sleeper, "flight software", "stopped", 0.0)
    wait_for(lambda: sleeper.state == "T" or None, "a stop")
    faults.end()
    wait_for(lambda: sleeper.state == "S" or None, "its going on")


def test_a_full_disk_takes_nothing_until_it_has_room_again(sleeper: Sleeper) -> None:
    before = resource.prlimit(sleeper.pid, resource.RLIMIT_FSIZE)
    faults = ProcessFaults()
    begun(faults, sleeper, "disk", "full", 0.0)
    assert resource.prlimit(sleeper.pid, resource.RLIMIT_FSIZE)[0] == 0
    faults.end()
    assert resource.prlimit(sleeper.pid, resource.RLIMIT_FSIZE) == before


def test_a_fault_of_another_process_or_unit_touches_nothing(sleeper: Sleeper) -> None:
    faults = ProcessFaults()
    begun(faults, sleeper, "simulator", "killed", 0.0)
    begun(faults, sleeper, "gyro", "off", 0.0)
    begun(faults, sleeper, "planner", "killed", 0.0)
    assert planners(sleeper.pid) == []
    assert sleeper.exit_code is None


@pytest.mark.long
def test_a_scenario_can_kill_the_flight_software(tmp_path: Path) -> None:
    killed = event("fault", unit="flight software", kind="killed", duration_s=0.0)
    flown = watched(tmp_path, ["short", killed, "sleep"], ["sleep", SHUT_DOWN])
    assert flown.errors["fsw"].startswith("fsw ended with code -9")
