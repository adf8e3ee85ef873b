"""What the loop tells the tick of its machine: news only, and numbers that last."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import pytest

from fsw.autopilot.signals import HostHealth
from fsw.runtime.host_watch import HostWatch

WELL = HostHealth()
SECOND = 1_000_000


@dataclass
class Machine:
    """A disk, links and two clocks."""

    now_us: int = 5 * SECOND
    wall_us: int = 10**15
    failed: str = ""
    size: int = 0
    free: int = 10**12
    received: int = 0
    missed: int = 0
    watch: HostWatch = field(init=False)

    def __post_init__(self) -> None:
        ground = cast(Any, SimpleNamespace(received=0))
        self.ground = ground
        self.watch = HostWatch(self, ground, lambda: self.now_us, lambda: self.wall_us)

    def failure(self) -> str:
        return self.failed

    def room(self) -> int:
        return self.free

    def second(self, **changes: int) -> HostHealth | None:
        """A second later, with more of what is counted."""
        self.now_us += SECOND
        self.wall_us += SECOND + changes.get("jump", 0)
        self.ground.received += changes.get("received", 0)
        self.missed += changes.get("missed", 0)
        self.size += changes.get("written", 0)
        return self.watch.look(self.missed)


@pytest.mark.requirement("REQ-TIME-3", "REQ-TIME-5")
def test_a_machine_that_is_well_is_no_news() -> None:
    machine = Machine()
    for _ in range(5):
        assert machine.second(missed=9, received=49, jump=499_999, written=10**5) is None


@pytest.mark.requirement("REQ-TIME-3", "REQ-TIME-5", "REQ-LINK-5")
@pytest.mark.parametrize(
    ("changes", "health"),
    [
        ({"missed": 12}, HostHealth(missed_ticks=12)),  # half of a gap of 50 ms
        ({"received": 2480}, HostHealth(datagrams=2500)),
        ({"jump": -500_000}, HostHealth(clock_jump_us=-500_000)),
        ({"jump": 3600 * SECOND}, HostHealth(clock_jump_us=3600 * SECOND)),
    ],
)
def test_what_happens_within_a_second_is_news_and_its_end_is_too(
    changes: dict[str, int], health: HostHealth
) -> None:
    machine = Machine()
    machine.second()
    assert machine.second(**changes) == health
    assert machine.second() == WELL
    assert machine.second() is None


def test_a_log_that_ends_is_told_once() -> None:
    machine = Machine(failed="flight.ulg ends early: No space left on device")
    assert machine.second() == HostHealth(log_failure=machine.failed)
    assert machine.second() is None


@pytest.mark.requirement("REQ-LOG-2")
def test_a_disk_that_will_be_full_within_a_minute_is_told_in_steps() -> None:
    machine = Machine(free=10**12)
    assert machine.second(written=10**6) is None
    machine.free = 42_000_000
    # 1 MB/s: some 42 s
    assert machine.second(written=10**6) == HostHealth(disk_left_us=40 * SECOND)
    machine.free -= 1_000_000
    assert machine.second(written=10**6) is None
    machine.free = 0
    assert machine.second(written=10**6) == HostHealth(disk_left_us=0)
