"""Pauses of a simulator in real time, on a clock that only a sleep moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from messages.frames import FrameWriter
from sitl.link.exchange import STALL_S, RealTime, SimulatorError
from sitl.link.step_grid import MAX_BEHIND_S, StepGrid

PERIOD_S = 0.002
HIL_ACTUATOR_CONTROLS, ARMED = 93, 128


@dataclass
class Clock:
    """Stands still between two sleeps; ``pauses`` stop the process on the way to a time."""

    now_s: float = 100.0
    pauses: dict[float, float] = field(default_factory=dict)  # seconds of it, by when it begins

    def __call__(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds
        for begin_s in [begin_s for begin_s in self.pauses if begin_s <= self.now_s]:
            self.now_s += self.pauses.pop(begin_s)


class Vehicle:
    """Answers every step at once while it is awake, as the link's endpoint sees it."""

    def __init__(self, awake: Callable[[], bool] = lambda: True) -> None:
        self._awake = awake
        self._writer = FrameWriter(1, 1)
        self._waiting: list[bytes] = []
        self.sent = 0

    def send(self, datagram: bytes) -> None:
        self.sent += 1
        if self._awake():
            values = (int(datagram), 1, *(0.5,) * 4, *(0.0,) * 12, ARMED)
            self._waiting.append(self._writer.frame(HIL_ACTUATOR_CONTROLS, *values))

    def receive(self) -> bytes | None:
        return self.receive_waiting()

    def receive_waiting(self) -> bytes | None:
        return self._waiting.pop(0) if self._waiting else None


class Run:
    """The exchange in real time, step after step."""

    def __init__(self, clock: Clock, awake: Callable[[], bool] = lambda: True) -> None:
        self.clock = clock
        vehicle: Any = Vehicle(awake)
        stop: Any = None
        self.exchange = RealTime(vehicle, 2, PERIOD_S, stop, clock, clock.sleep)
        self.ends_s: list[float] = []
        self.armed: list[bool] = []

    def steps(self, count: int) -> None:
        for number in range(len(self.ends_s), len(self.ends_s) + count):
            answer = self.exchange.step(number, number, b"%d" % number, lambda: None)
            self.ends_s.append(self.clock.now_s)
            self.armed.append(answer.controls.armed)


def test_every_step_ends_on_the_grid() -> None:
    run = Run(Clock())
    run.steps(500)
    length_s = run.ends_s[-1] - run.ends_s[0]
    assert length_s == pytest.approx(499 * PERIOD_S)
    counts = run.exchange.counts
    assert (counts.missed, counts.pauses, counts.paused_s) == (0, 0, 0.0)


@pytest.mark.parametrize("pause_s", [0.010, MAX_BEHIND_S - 0.003])
def test_a_short_stop_is_caught_up_with(pause_s: float) -> None:
    clock = Clock()
    run = Run(clock)
    run.steps(100)
    clock.pauses[clock.now_s] = pause_s
    run.steps(100)
    assert run.ends_s[-1] - run.ends_s[0] == pytest.approx(199 * PERIOD_S)
    assert run.exchange.counts.pauses == 0


@pytest.mark.parametrize("pause_s", [MAX_BEHIND_S + 0.003, 1.0, 30.0])
def test_a_long_stop_moves_the_grid_by_whole_steps(pause_s: float) -> None:
    clock = Clock()
    run = Run(clock)
    run.steps(100)
    clock.pauses[clock.now_s] = pause_s
    run.steps(100)
    counts = run.exchange.counts
    assert (counts.pauses, all(run.armed)) == (1, True)
    assert pause_s - PERIOD_S <= counts.paused_s <= pause_s
    phase = counts.paused_s / PERIOD_S
    assert phase == pytest.approx(round(phase), abs=1e-6)
    assert run.ends_s[-1] - run.ends_s[0] == pytest.approx(199 * PERIOD_S + counts.paused_s)
    # Two steps may come together, where the first was stopped; nothing is caught up beyond that.
    hurried = sum(b - a < 0.9 * PERIOD_S for a, b in zip(run.ends_s, run.ends_s[1:], strict=False))
    assert hurried <= 1


def test_a_machine_that_is_always_too_slow_never_hurries_for_more_than_the_limit() -> None:
    clock = Clock()
    grid = StepGrid(PERIOD_S, clock, clock.sleep)
    for number in range(1000):
        clock.sleep(1.5 * PERIOD_S)  # the work of a step
        grid.wait(number)
        assert clock.now_s - (100.0 + (number + 1) * PERIOD_S) >= 0.0
    assert clock.now_s == pytest.approx(100.0 + 1500 * PERIOD_S)


def test_what_the_simulator_stood_still_is_not_the_vehicles_silence() -> None:
    clock = Clock()
    awake = True
    run = Run(clock, lambda: awake)
    run.steps(100)
    clock.pauses[clock.now_s] = 3.0
    awake = False
    run.steps(40)  # 80 ms
    assert run.exchange.silent_since is None
    run.steps(20)
    assert run.exchange.silent_since == 99
    run.steps(430)  # 980 ms: the controls are still held, and told from new ones
    assert all(run.armed)
    assert run.exchange.held_s == pytest.approx(0.98, abs=0.004)
    run.steps(20)
    assert not run.armed[-1]


def test_a_silent_vehicle_ends_the_run_and_the_last_step_it_answered_is_named() -> None:
    awake = True
    run = Run(Clock(), lambda: awake)
    run.steps(100)
    awake = False
    begin_s = run.clock.now_s
    with pytest.raises(SimulatorError, match="after step 99"):
        run.steps(2000)
    assert run.clock.now_s - begin_s == pytest.approx(STALL_S, abs=2 * PERIOD_S)


def test_a_vehicle_that_speaks_again_was_not_silent() -> None:
    awake = True
    run = Run(Clock(), lambda: awake)
    run.steps(100)
    awake = False
    run.steps(200)
    awake = True
    run.steps(10)
    assert run.exchange.silent_since is None
    assert run.exchange.counts.missed == 200
