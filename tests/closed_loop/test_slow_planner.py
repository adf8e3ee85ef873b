"""A planner that takes 40, 99, 101 or 250 ms: each has its defined response, and costs no barrier.

The planner is a process of its own: it works on one request at a time, and what was asked meanwhile
waits, the newest in front. An answer within its period is flown at its age and counted as a missed
deadline; a later one answers a question that was given up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import pytest

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode, Plan, PlanFailure, PlanRequest
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, Flight, command, hover

in_long = partial(pytest.param, marks=pytest.mark.long)

SLOW_FROM_S, SLOW_TO_S, END_S = 2.0, 4.0, 6.0


@dataclass
class OneAtATime:
    """A flight's planner, which answers when its time of work is over, in simulated time."""

    flight: SlowFlight
    waiting: PlanRequest | None = None
    at_work: PlanRequest | None = None
    ready_us: int = 0

    def submit(self, request: PlanRequest) -> None:
        self.waiting = request
        self._begin(self.flight.sim.t_us)

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        request = self.at_work
        if request is None or t_us < max(self.ready_us, request.t_apply_us):
            return None
        self.at_work = None
        self._begin(t_us)
        assert self.flight.planner is not None
        return self.flight.planner.plan(request)

    def close(self) -> None:
        """Nothing to stop."""

    def _begin(self, now_us: int) -> None:
        slow = SLOW_FROM_S <= self.flight.sim.time_s < SLOW_TO_S
        if self.at_work is None and self.waiting is not None:
            self.at_work, self.waiting = self.waiting, None
            self.ready_us = now_us + (1000 * self.flight.takes_ms if slow else 1000)


@dataclass
class SlowFlight(Flight):
    """A flight whose planner is slow for a while."""

    takes_ms: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        self.closed.planner = OneAtATime(self)


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-PLAN-1", "REQ-PLAN-2")
@pytest.mark.parametrize(
    ("takes_ms", "missed", "given_up", "brakes"),
    [
        (19, 0, 0, False),
        in_long(40, 20, 0, False),
        (99, 20, 0, False),
        (101, 20, 20, True),
        in_long(250, 20, 20, True),
    ],
)
def test_a_slow_planner_has_its_response(
    takes_ms: int, missed: int, given_up: int, brakes: bool
) -> None:
    flight = SlowFlight(load_scenario("walls"), seed=11, takes_ms=takes_ms)
    flight.follow()
    flight.run(SLOW_TO_S - flight.sim.time_s)
    counters = flight.snapshot.counters
    assert counters.missed_deadlines == pytest.approx(missed, abs=1)
    assert counters.fallbacks == pytest.approx(given_up, abs=1)
    assert (Condition.PLAN_STALE.value in flight.snapshot.failures) == brakes
    if brakes:
        assert math.dist(flight.sim.truth().v_WB, (0.0, 0.0, 0.0)) < 0.15, "disturbed, but held"
    flight.run(END_S - flight.sim.time_s)
    assert flight.snapshot.failures == ()
    assert flight.snapshot.counters.missed_deadlines == pytest.approx(missed, abs=3)
    assert flight.sim.min_margin_m is not None
    assert flight.sim.min_margin_m > 0.0


@pytest.mark.long
@pytest.mark.requirement("REQ-PLAN-2")
@pytest.mark.parametrize(
    ("name", "gone_s"),
    [
        ("walls", 3.1),
        in_long("walls", 9.4),
        in_long("walls", 14.0),
        ("branches", 7.9),
        in_long("branches", 11.3),
    ],
)
def test_a_planner_that_is_gone_costs_no_barrier(name: str, gone_s: float) -> None:
    last = round(10 * gone_s)
    flight = Flight(
        load_scenario(name),
        seed=4,
        config=flight_config(body="points"),
        late_ticks=lambda plan: 0 if plan < last else 10**9,
    )
    flight.follow()
    flight.run(gone_s + 3.0)
    assert Condition.PLAN_STALE.value in flight.snapshot.failures
    assert flight.sim.min_margin_m is not None
    assert flight.sim.min_margin_m > 0.0


@pytest.mark.long
@pytest.mark.parametrize("tilt_deg", [4.0, 12.0])
def test_without_plans_it_brakes_with_the_tilt_that_the_plan_may_use(tilt_deg: float) -> None:
    """PLN_TILT_MAX reaches braking: at a metre a second it leans as far as that, no farther."""
    config = flight_config(body="points")
    limits = replace(config.planner.limits, tilt=math.radians(tilt_deg))
    config = replace(config, planner=replace(config.planner, limits=limits))
    flight = Flight(hover(), config=config, late_ticks=lambda plan: 0 if plan < 60 else 10**9)
    flight.step(command(ARM, 1.0))
    flight.run(0.5)
    flight.step(command(192, -1.0, 0.0, 0.0, 0.0, 9.0, 0.0, -2.0, frame=1))
    assert flight.mode is Mode.HOLD
    asked = 0.0
    for _ in range(40):
        flight.run(0.2)
        if Condition.PLAN_STALE.value in flight.snapshot.failures:
            assert flight.state.plan_state is not None
            asked = max(asked, -flight.state.plan_state.a[0])
    most = GRAVITY * math.tan(math.radians(tilt_deg))
    assert 0.7 * most < asked < 1.02 * most
    assert math.dist(flight.sim.truth().v_WB, (0.0, 0.0, 0.0)) < 0.05
