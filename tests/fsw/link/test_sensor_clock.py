"""The vehicle's time where the sensors' clock jumps, on a clock of its own."""

from __future__ import annotations

import itertools
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fsw.link.sensor_clock import SensorClock

PERIOD_US = 2_000
BEGIN_US = 20_000_000


class RealTime:
    """A look a period at what has come."""

    def __init__(self) -> None:
        self.now_us = 70_000_000
        self.said: list[str] = []
        self.jumps: list[int] = []
        self.steps = SensorClock(
            PERIOD_US, lambda: self.now_us, self.said.append, self.jumps.append
        )
        self.times: list[int | None] = []  # of the vehicle, one a look
        for k in range(10):
            self.look(BEGIN_US + PERIOD_US * k)

    def look(self, *stamps: int) -> int | None:
        """Steps of a simulator that does not number its frames."""
        return self.numbered(*((t_us, 0) for t_us in stamps))

    def numbered(self, *steps: tuple[int, int]) -> int | None:
        """Steps by their stamps and the numbers of their frames."""
        self.now_us += PERIOD_US
        newest = None
        for t_us, number in steps:
            if self.steps.follows(t_us, number):
                newest = t_us - self.steps.ahead_us
        self.steps.looks += 1
        if newest is not None:
            self.steps.note_time()
        self.times.append(newest)
        return newest


def after(looks: int) -> int:
    """The vehicle's time so many looks after the first one."""
    return BEGIN_US + PERIOD_US * looks


@pytest.mark.parametrize("lost", [0, 1, 3, 20])
@pytest.mark.parametrize("jump_us", [-6_000_000, -500_000, 100_000, 500_000, 12_000_000])
def test_the_vehicle_s_time_goes_on_with_the_time_that_has_passed(jump_us: int, lost: int) -> None:
    flight = RealTime()
    for _ in range(lost):
        flight.look()
    for k in range(10 + lost, 100):
        flight.look(after(k) + jump_us)
    assert flight.times[-1] == after(99)
    assert flight.jumps == [jump_us]
    known = [one for one in flight.times if one is not None]
    assert all(0 < b - a <= 50_000 for a, b in itertools.pairwise(known))


def test_a_clock_that_jumps_there_and_back_again_is_told_twice() -> None:
    flight = RealTime()
    for k in range(10, 100):
        flight.look(after(k) + (12_000_000 if 40 <= k < 70 else 0))
    assert flight.times[-1] == after(99)
    assert flight.jumps == [12_000_000, -12_000_000]
    assert flight.steps.ahead_us == 0
    assert flight.said == []


@pytest.mark.parametrize("lag", [1, 2, 5, 40])
@pytest.mark.parametrize("late_first", [True, False])
def test_every_step_comes_twice_and_late_and_some_only_late(lag: int, late_first: bool) -> None:
    chance = random.Random(7)
    flight = RealTime()
    for k in range(10, 2000):
        came = [after(k)] if chance.random() > 0.1 else []
        late = [after(k - lag)] if k - lag >= 10 else []
        flight.look(*(late + came if late_first else came + late))
    assert flight.jumps == []
    assert flight.said == []
    known = [one for one in flight.times if one is not None]
    assert all(a < b for a, b in itertools.pairwise(known))


def test_a_jump_is_found_where_every_step_comes_twice_and_late() -> None:
    flight = RealTime()
    stamps = [after(k) for k in range(10, 50)] + [after(k) - 500_000 for k in range(50, 100)]
    for k, t_us in enumerate(stamps):
        flight.look(*stamps[max(k - 3, 0) : max(k - 2, 0)], t_us)
    assert flight.jumps == [-500_000]
    assert flight.times[-1] == after(99)


@pytest.mark.parametrize("silent_us", [60_000, 500_000, 3_000_000])
def test_a_stamp_that_is_as_far_ahead_as_the_link_was_silent_is_taken_at_once(
    silent_us: int,
) -> None:
    flight = RealTime()
    flight.now_us += silent_us
    assert flight.look(after(10) + silent_us) == after(10) + silent_us
    assert flight.jumps == []


@pytest.mark.parametrize("wrong_us", [60_000, 12_000_000, 1 << 63, (1 << 64) - PERIOD_US])
def test_a_stamp_that_is_wrong_once_is_told_and_ignored(wrong_us: int) -> None:
    flight = RealTime()
    flight.look(after(10) + wrong_us if wrong_us < 1 << 62 else wrong_us)
    assert flight.look(after(11)) == after(11)
    assert flight.jumps == []
    (said,) = flight.said
    assert "ahead: ignored" in said


def test_no_step_follows_a_stamp_beyond_all_times() -> None:
    flight = RealTime()
    for k in range(50):
        assert flight.look((1 << 63) + PERIOD_US * k) is None
    assert flight.jumps == []


@pytest.mark.parametrize("jump_us", [-6_000_000, 6_000_000])
def test_a_wrong_stamp_right_behind_a_jump_is_doubted_like_any_other(jump_us: int) -> None:
    flight = RealTime()
    confirms = 13 if jump_us < 0 else 11
    for k in range(10, 30):
        t_us = after(k) + jump_us
        more = (t_us + 5_000_000,) if k == confirms else ()
        assert flight.look(t_us, *more) == (after(k) if k >= confirms else None)
    assert flight.jumps == [jump_us]


@pytest.mark.parametrize("steps_back", [2, 4, 5, 6, 25])
def test_from_five_steps_on_a_clock_that_goes_back_is_told(steps_back: int) -> None:
    flight = RealTime()
    for k in range(10, 100):
        flight.look(after(k - steps_back))
    assert flight.jumps == ([-PERIOD_US * steps_back] if steps_back >= 5 else [])


FRAMES = 4  # a step


class Network:
    """Numbers steps as they are sent, and loses, doubles and delays them, by up to 40 ms."""

    def __init__(self, chance: random.Random, lost: float, doubled: float, late: float) -> None:
        self.flight = RealTime()
        self.number = 0
        self._chance = chance
        self._lost, self._doubled, self._late = lost, doubled, late
        self._due: dict[int, list[tuple[int, int]]] = {}  # steps by the look at which they come

    def send(self, k: int, t_us: int, *, surely: bool = False) -> None:
        self.number = (self.number + FRAMES) % 256
        step = (t_us, self.number)
        come = [] if self._chance.random() < self._lost else [0]
        if self._chance.random() < self._late:
            come = [self._chance.randint(1, 20)]
        if self._chance.random() < self._doubled:
            come.append(self._chance.randint(0, 20))
        for later in [0, *come[1:]] if surely else come:
            self._due.setdefault(k + later, []).append(step)
        steps = self._due.pop(k, [])
        self._chance.shuffle(steps)
        self.flight.numbered(*steps)


shares = st.floats(0.0, 0.3)


@pytest.mark.requirement("REQ-TIME-4")
@settings(deadline=None, max_examples=200)
@given(st.integers(0, 2**32), shares, shares, shares, st.integers(0, 25))
def test_a_clock_that_goes_back_by_a_tick_is_told_and_no_late_or_doubled_step_is(
    seed: int, lost: float, doubled: float, late: float, steps_back: int
) -> None:
    """Whatever the network does to other steps; of the two at the jump it delays none."""
    network = Network(random.Random(seed), lost, doubled, late)
    for k in range(10, 300):
        back_us = PERIOD_US * steps_back if k >= 200 else 0
        network.send(k, after(k) - back_us, surely=k in (199, 200))
    flight = network.flight
    assert flight.jumps == ([-PERIOD_US * steps_back] if 0 < steps_back <= 20 else flight.jumps)
    assert steps_back or not flight.jumps
    known = [one for one in flight.times if one is not None]
    assert all(a < b for a, b in itertools.pairwise(known))
    assert known[-1] <= after(299)


def test_where_nothing_is_numbered_four_steps_are_needed() -> None:
    flight = RealTime()
    for k in range(10, 30):
        flight.look(after(k) - 3 * PERIOD_US)
    assert flight.jumps == []


def test_a_step_that_is_repeated_in_lockstep_may_be_numbered_anew() -> None:
    jumps: list[int] = []
    steps = SensorClock(PERIOD_US, lambda: 0, lambda _: None, jumps.append)
    for k in range(10):
        assert steps.follows(BEGIN_US + PERIOD_US * k, 2 * k)
        assert not steps.follows(BEGIN_US + PERIOD_US * k, 2 * k + 1)
    assert jumps == []


def test_in_lockstep_a_repeated_old_step_counts_after_a_silence_alone() -> None:
    jumps: list[int] = []
    steps = SensorClock(PERIOD_US, lambda: 0, lambda _: None, jumps.append)
    assert [steps.follows(BEGIN_US + PERIOD_US * k, 0) for k in range(10)] == [True] * 10
    for _ in range(5):
        assert not steps.follows(BEGIN_US, 0)
        assert not steps.follows(BEGIN_US + PERIOD_US, 0)
    steps.silences += 1
    assert not steps.follows(BEGIN_US, 0)
    assert not steps.follows(BEGIN_US, 0)
    assert steps.follows(BEGIN_US + PERIOD_US * 10, 0)
    assert not steps.follows(BEGIN_US, 0)
    steps.silences += 1
    assert steps.follows(BEGIN_US, 0)
    assert jumps == [-PERIOD_US * 11]
    assert steps.ahead_us == -PERIOD_US * 11
