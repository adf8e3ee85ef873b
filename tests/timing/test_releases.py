"""Late and lost sensor frames, ticks that overrun, clocks that jump: each has its response."""

from __future__ import annotations

import random
from collections.abc import Callable
from itertools import pairwise

import pytest

from fsw.runtime.releases import (
    LEAD_US,
    MAX_STALE_TICKS,
    DeadlineMonitor,
    Release,
    ReleaseSchedule,
    ScheduledReleases,
)
from tests.timing.virtual_time import FIRST_US, PERIOD_US, VirtualSensors, VirtualTime, frame

SETTLED = 25  # the schedule has begun by then


class Loop:
    """Takes releases and works on each for a while."""

    def __init__(self, sensors: VirtualSensors, work_us: int = 150) -> None:
        self.time = sensors.time
        self.work_us: Callable[[int], int] = lambda tick: work_us
        self.deadlines = DeadlineMonitor()
        self.releases = ScheduledReleases(
            sensors, self.time.clock, self.time.sleep, frame(FIRST_US), PERIOD_US, self.deadlines
        )
        self.ticks: list[Release] = []
        self.nothing = 0

    def run(self, times: int) -> list[Release]:
        """The ticks of so many releases."""
        begin = len(self.ticks)
        for _ in range(times):
            release = self.releases.next()
            if release is None:
                self.nothing += 1
            else:
                self.ticks.append(release)
                self.time.work(self.work_us(len(self.ticks)))
        noted = (round((last - first) / PERIOD_US) + 1 for first, last in self.deadlines.missed)
        # Every skipped release is noted once; a grid that follows a clock has other periods.
        assert sum(noted) == pytest.approx(self.releases.skipped, rel=0.001)
        return self.ticks[begin:]


def stamps(ticks: list[Release]) -> list[int]:
    return [(tick.sensors.t_us - FIRST_US) // PERIOD_US for tick in ticks]


@pytest.fixture
def time() -> VirtualTime:
    return VirtualTime()


def test_every_frame_has_its_tick_on_the_grid(time: VirtualTime) -> None:
    loop = Loop(VirtualSensors(time))
    loop.run(SETTLED)
    ticks = loop.run(300)
    assert stamps(ticks) == list(range(SETTLED + 1, SETTLED + 301))
    assert {tick.begun_us - tick.due_us for tick in ticks} == {0}
    assert all(b.due_us - a.due_us == PERIOD_US for a, b in pairwise(ticks))
    assert (loop.releases.skipped, loop.releases.stale, loop.nothing) == (0, 0, 0)


@pytest.mark.requirement("REQ-TIME-1")
@pytest.mark.parametrize("late_us", [LEAD_US + 100, 1_900])
def test_a_late_frame_does_not_stop_the_tick_which_gets_its_age(
    time: VirtualTime, late_us: int
) -> None:
    loop = Loop(VirtualSensors(time, lambda step: late_us if step == 100 else 0))
    ticks = loop.run(200)
    assert stamps(ticks) == list(range(1, 201))
    assert [stamps([tick])[0] for tick in ticks if tick.stale_us] == [100]
    assert ticks[99].stale_us == PERIOD_US
    assert (loop.releases.skipped, loop.releases.stale) == (0, 1)


def test_a_frame_that_is_less_late_than_the_lead_changes_nothing(time: VirtualTime) -> None:
    loop = Loop(VirtualSensors(time, lambda step: LEAD_US - 50 if step == 100 else 0))
    assert stamps(loop.run(200)) == list(range(1, 201))
    assert loop.releases.stale == 0


@pytest.mark.requirement("REQ-TIME-1")
@pytest.mark.parametrize("lost", [1, 2, MAX_STALE_TICKS])
def test_lost_frames_are_flown_through_on_the_last_readings(time: VirtualTime, lost: int) -> None:
    loop = Loop(VirtualSensors(time, lambda step: None if 100 <= step < 100 + lost else 0))
    ticks = loop.run(200)
    assert stamps(ticks) == list(range(1, 201))
    aged = [tick.stale_us // PERIOD_US for tick in ticks if tick.stale_us]
    assert aged == list(range(1, lost + 1))
    assert loop.releases.skipped == 0


@pytest.mark.requirement("REQ-TIME-2")
def test_after_ten_milliseconds_without_sensors_nothing_is_commanded(time: VirtualTime) -> None:
    silent = range(100, 150)
    loop = Loop(VirtualSensors(time, lambda step: None if step in silent else 0))
    ticks = loop.run(300)
    assert loop.releases.stale == MAX_STALE_TICKS
    assert loop.nothing == len(silent) - MAX_STALE_TICKS
    assert loop.releases.skipped == loop.nothing
    assert stamps(ticks)[98:106] == [99, 100, 101, 102, 103, 104, 150, 151]


def test_a_simulator_that_paused_and_catches_up_is_taken_at_its_newest_frame(
    time: VirtualTime,
) -> None:
    """Forty frames arrive at once, 80 ms late; from then on they are on time."""
    loop = Loop(
        VirtualSensors(time, lambda step: max(0, (140 - step) * PERIOD_US) if step >= 100 else 0)
    )
    ticks = loop.run(300)
    assert stamps(ticks)[:104] == list(range(1, 105))
    assert stamps(ticks)[104:] == list(range(140, 140 + len(ticks) - 104))
    assert loop.releases.stale == MAX_STALE_TICKS


@pytest.mark.parametrize("pause_us", [80_000, 1_000_000, 3_000_000])
def test_a_simulator_that_stood_still_is_met_where_it_goes_on(
    time: VirtualTime, pause_us: int
) -> None:
    loop = Loop(VirtualSensors(time, lambda step: 0 if step < 100 else pause_us))
    loop.run(100 + pause_us // PERIOD_US)
    went_on = loop.run(30)
    after = loop.run(200)
    # The first five were anticipated, and had their tick before the pause.
    assert stamps(went_on)[0] == 105
    assert stamps(went_on + after) == list(range(105, 105 + len(went_on) + 200))
    assert {tick.stale_us for tick in after} == {0}


@pytest.mark.parametrize(("work_us", "skipped"), [(1_990, 0), (2_500, 0), (3_990, 1), (6_100, 2)])
def test_a_tick_that_overruns_makes_the_next_late_and_shifts_nothing(
    time: VirtualTime, work_us: int, skipped: int
) -> None:
    loop = Loop(VirtualSensors(time))
    loop.run(SETTLED)
    loop.work_us = lambda tick: work_us if tick == 100 else 150
    ticks = loop.run(200)
    before, after = ticks[:70], ticks[-70:]
    assert (after[0].due_us - before[0].due_us) % PERIOD_US == 0
    assert {tick.begun_us - tick.due_us for tick in before + after} == {0}
    assert loop.releases.skipped == skipped
    assert loop.releases.stale == 0
    late = [tick.begun_us - tick.due_us for tick in ticks if tick.begun_us > tick.due_us]
    assert len(late) == (work_us > PERIOD_US)


@pytest.mark.parametrize("early_us", [500, 1_500])
def test_a_frame_that_comes_early_costs_its_predecessor_and_nothing_more(
    time: VirtualTime, early_us: int
) -> None:
    """The simulator was behind and hurries: two frames in one period, once."""
    loop = Loop(VirtualSensors(time, lambda step: -early_us if step == 100 else 0))
    ticks = loop.run(300)
    taken = [step for step in range(1, 301) if step != 99 or early_us == 500]
    assert stamps(ticks)[: len(taken)] == taken
    assert loop.releases.skipped + loop.releases.stale <= 2


@pytest.mark.requirement("REQ-TIME-6")
def test_a_clock_that_jumps_ahead_skips_and_keeps_the_grid(time: VirtualTime) -> None:
    """The machine was suspended: wall time has passed, and no sensor frame came meanwhile."""
    sensors = VirtualSensors(time)
    loop = Loop(sensors)
    first = loop.run(100)[-1]
    time.now_us += 3_000_000
    ticks = loop.run(100)
    assert loop.releases.skipped == pytest.approx(1500, abs=1)
    assert (ticks[-1].due_us - first.due_us) % PERIOD_US == 0
    assert ticks[-1].stale_us == 0


@pytest.mark.requirement("REQ-TIME-6")
@pytest.mark.parametrize("back_us", [700, 50_000, 1_000_000])
def test_a_clock_that_jumps_back_is_waited_for_and_repeats_no_release(
    time: VirtualTime, back_us: int
) -> None:
    loop = Loop(VirtualSensors(time))
    loop.run(100)
    jumped_at_us = time.now_us
    time.now_us -= back_us
    ticks = loop.run(200)
    assert ticks[0].begun_us > jumped_at_us
    assert stamps(ticks) == list(range(101, 301))
    assert {b.due_us - a.due_us for a, b in pairwise(ticks)} == {PERIOD_US}
    assert all(tick.begun_us >= tick.due_us for tick in ticks)
    assert (loop.releases.skipped, loop.releases.stale, loop.nothing) == (0, 0, 0)


def test_a_schedule_whose_clock_jumps_back_goes_on_to_the_next_release() -> None:
    schedule = ReleaseSchedule(0.0, PERIOD_US)
    schedule.advance(10_100)
    assert (schedule.index, schedule.due_us) == (5, 10_000)
    assert schedule.advance(1_000) == 1
    assert schedule.due_us == 12_000


def test_measuring_an_arrival_leaves_the_ground_links_unread_for_a_moment_only(
    time: VirtualTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    sensors = VirtualSensors(time)
    loop = Loop(sensors)
    loop.run(SETTLED)
    unread_us: list[int] = []

    def wait(seconds: float) -> bool:
        begin = time.now_us
        there = VirtualSensors.wait(sensors, seconds)
        unread_us.append(time.now_us - begin)
        return there

    monkeypatch.setattr(sensors, "wait", wait)
    loop.run(1000)
    measurements = [duration for duration in unread_us if duration]
    assert len(measurements) == pytest.approx(40, abs=1)
    assert max(measurements) < PERIOD_US / 5


@pytest.mark.parametrize("parts_per_million", [-200.0, 200.0])
def test_sensors_on_another_clock_are_followed(time: VirtualTime, parts_per_million: float) -> None:
    period = PERIOD_US * (1.0 + 1e-6 * parts_per_million)
    sensors = VirtualSensors(time, period_us=period)
    loop = Loop(sensors)
    ticks = loop.run(8_000)  # 16 s, in which the clocks part by 3.2 ms
    assert loop.releases.stale + loop.releases.skipped == 0
    assert stamps(ticks) == list(range(1, 8_001))


def test_frames_that_always_come_behind_their_tick_are_waited_for_once(time: VirtualTime) -> None:
    """The link became slower by 1 ms for good: time must not stay ahead of the frames."""
    loop = Loop(VirtualSensors(time, lambda step: 1_000 if step >= 100 else 0))
    ticks = loop.run(1_000)
    assert loop.nothing == 1
    assert loop.releases.stale < 10
    assert all(tick.stale_us == 0 for tick in ticks[150:])


def test_a_simulator_slower_than_time_is_followed_at_its_own_pace(time: VirtualTime) -> None:
    loop = Loop(VirtualSensors(time, period_us=1.25 * PERIOD_US))
    loop.run(100)
    ticks = loop.run(1_000)
    assert max(tick.stale_us for tick in ticks) <= 2 * PERIOD_US
    assert stamps(ticks) == sorted(stamps(ticks))
    wall_us = time.now_us - loop.ticks[0].begun_us
    assert stamps(ticks)[-1] == pytest.approx(wall_us / (1.25 * PERIOD_US), abs=5)


def test_silence_ends_in_nothing_to_tick_on_so_that_the_loop_can_look_at_its_clock(
    time: VirtualTime,
) -> None:
    loop = Loop(VirtualSensors(time, lambda step: None if step > 50 else 0))
    loop.run(1_200)
    assert loop.nothing > 1_000
    assert len(loop.ticks) == 50 + MAX_STALE_TICKS


@pytest.mark.parametrize("seed", range(6))
def test_whatever_a_noisy_machine_did_afterwards_every_frame_has_its_tick(
    time: VirtualTime, seed: int
) -> None:
    """Both halves are stopped at random for up to 30 ms over 4 s, then left alone."""
    dice = random.Random(seed)
    noisy = 2_000
    pauses = {step: dice.randint(500, 30_000) for step in dice.sample(range(30, noisy), 60)}
    delays, behind = [], 0
    for step in range(noisy):
        behind = max(behind - PERIOD_US + 50, pauses.get(step, 0), dice.randint(0, 80))
        delays.append(behind)
    loop = Loop(VirtualSensors(time, lambda step: delays[step] if step < noisy else 20))
    loop.work_us = lambda tick: dice.randint(500, 30_000) if dice.random() < 0.02 else 150
    while time.now_us < 50_000_000 + noisy * PERIOD_US + 60_000:
        loop.run(1)
    loop.work_us = lambda tick: 150
    loop.run(50)
    missing = loop.releases.stale + loop.releases.skipped
    ticks = loop.run(500)
    assert loop.releases.stale + loop.releases.skipped == missing
    assert stamps(ticks) == list(range(stamps(ticks)[0], stamps(ticks)[0] + 500))
    assert len(loop.ticks) > 0.7 * stamps(ticks)[-1]
