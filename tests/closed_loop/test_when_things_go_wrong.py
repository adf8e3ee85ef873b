"""Late plans, no plans, no estimate, a hard push: what the vehicle does about them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import pytest

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.shapes.vertical_cylinder import vertical_cylinder
from fsw.autopilot.signals import (
    MessageSource,
    Mode,
    Plan,
    PlanFailure,
    PlanRequest,
    PlanTimings,
    SafeSet,
    SafeSetAnnouncement,
    SensorFrame,
    SolverStatus,
    Zone,
)
from sitl.scenario_file import load_scenario
from sitl.simulation import START_US, STEP_US
from tests.closed_loop.harness import ARM, Flight, command, hover, real_planner

in_long = partial(pytest.param, marks=pytest.mark.long)


class FailsFrom:
    """A planner that answers up to some plan and then only fails."""

    def __init__(self, planner: Planner, first_failure: int) -> None:
        self._planner = planner
        self._first_failure = first_failure

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        if request.plan_id < self._first_failure:
            return self._planner.plan(request)
        nothing = PlanTimings(0.0, 0.0, 0.0)
        return PlanFailure(request.plan_id, SolverStatus.INFEASIBLE, "", nothing)


@pytest.mark.requirement("REQ-PLAN-1")
def test_a_late_plan_is_counted_and_flown() -> None:
    flight = Flight(load_scenario("workspace"), late_ticks=lambda plan: 3 if plan == 5 else 0)
    flight.follow()
    missed_at = set()
    flown = set()
    for _ in range(500):
        outputs = flight.step()
        plan = outputs.snapshot.plan
        if plan is not None:
            flown.add(plan.plan_id)
        missed_at.add((outputs.snapshot.counters.missed_deadlines, len(flown)))
    counters = flight.snapshot.counters
    assert (counters.missed_deadlines, counters.fallbacks) == (1, 0)
    assert (1, 5) in missed_at, "counted while plan 4 was still flown"
    assert 5 in flown
    assert flight.sim.min_margin_m is not None
    assert flight.sim.min_margin_m > 0.0


def test_a_plan_that_never_comes_is_counted_given_up_and_survived() -> None:
    flight = Flight(load_scenario("workspace"), late_ticks=lambda plan: 10**6 if plan == 5 else 0)
    flight.follow()
    flight.run(1.0)
    counters = flight.snapshot.counters
    assert (counters.missed_deadlines, counters.fallbacks) == (1, 1)
    assert flight.mode is Mode.TRAJECTORY
    assert flight.snapshot.failures == ()


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-PLAN-2")
@pytest.mark.parametrize("first_failure", [0, 30], ids=["from the start", "in motion"])
def test_without_plans_the_vehicle_brakes_and_stays_put(first_failure: int) -> None:
    config = flight_config(body="points")
    planner = FailsFrom(real_planner(config), first_failure)
    flight = Flight(load_scenario("workspace-calm"), config=config, planner=planner)
    flight.follow()
    flight.run(0.1 * first_failure + 0.5)
    assert Condition.PLAN_STALE.value in flight.snapshot.failures
    told = f"{Condition.PLAN_STALE.value}: planner infeasible, last plan 0.3"
    assert any(text.startswith(told) and text.endswith(": brake") for text in flight.texts)
    braked = flight.sim.truth().p_WB
    for _ in range(6):
        flight.run(0.5)
        assert math.dist(flight.sim.truth().p_WB, braked) < 0.1
    assert math.hypot(*flight.sim.truth().v_WB) < 0.02
    # The sphere that follows the target leaves the vehicle behind.
    assert flight.mode is Mode.HOLD
    assert any("outside the safe set" in text for text in flight.texts)


def lost_between(first: int, last: int) -> Callable[[SensorFrame], SensorFrame]:
    """Position is no number in steps first..last."""

    def spoil(frame: SensorFrame) -> SensorFrame:
        step = (frame.t_us - START_US) // STEP_US
        return replace(frame, p_WB=(math.nan, 0.0, 0.0)) if first <= step <= last else frame

    return spoil


def all_lost_between(first: int, last: int) -> Callable[[SensorFrame], SensorFrame]:
    """No reading is a number in steps first..last."""
    nothing = (math.nan, math.nan, math.nan)

    def spoil(frame: SensorFrame) -> SensorFrame:
        step = (frame.t_us - START_US) // STEP_US
        lost = replace(frame, p_WB=nothing, gyro_B=nothing, qd_arm=(math.nan, 0.0))
        return lost if first <= step <= last else frame

    return spoil


@pytest.mark.requirement("REQ-EST-8")
def test_an_attitude_that_is_unknown_for_long_ends_the_flight_for_good() -> None:
    flight = Flight(load_scenario("workspace"), spoil=all_lost_between(300, 1000))
    flight.follow()
    for step in range(2, 720):
        outputs = flight.step()
        if step < 500:
            assert sum(outputs.actuators.rotor_thrust) > 10.0
        elif step > 660:
            assert flight.mode is Mode.FAULT
            assert outputs.actuators.rotor_thrust == (0.0, 0.0, 0.0, 0.0)
            assert outputs.actuators.joint_torque == (0.0, 0.0)
            assert not outputs.snapshot.armed
    assert any(Condition.ATTITUDE_LOST.value in text for text in flight.texts)
    flight.step(command(ARM, 1.0))
    assert flight.mode is Mode.FAULT


def test_a_few_lost_frames_are_flown_through() -> None:
    flight = Flight(load_scenario("workspace"), spoil=lost_between(300, 303))
    flight.follow()
    flight.run(1.0)
    assert flight.mode is Mode.TRAJECTORY
    assert flight.snapshot.failures == ()


@dataclass
class OnePush:
    """A constant push for a while, in m/s^2 (world) or N m (body)."""

    value: tuple[float, float, float]
    torque: bool
    first: int
    last: int
    name: str = "one push"
    kind: str = "push"

    def sample(self, step: int) -> tuple[float, float, float]:
        return self.value if self.first <= step <= self.last else (0.0, 0.0, 0.0)

    def held_until(self, step: int) -> float:
        return step + 1


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-ACT-10")
@pytest.mark.parametrize(
    ("value", "torque", "felt"),
    [
        in_long((12.0, 0.0, 0.0), False, 0.1),
        in_long((0.0, -12.0, 0.0), False, 0.1),
        ((6.0, 6.0, -9.0), False, 0.1),
        in_long((3.0, 0.0, 0.0), True, 0.01),
        ((0.0, -3.0, 0.0), True, 0.002),
    ],
)
def test_a_hard_push_is_recovered_from(
    value: tuple[float, float, float], torque: bool, felt: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A disturbance of a kind that no scenario can name.
    monkeypatch.setattr("sitl.simulation.push", lambda item, seed, step_s: item)
    push: Any = OnePush(value, torque, 100, 175)
    flight = Flight(replace(hover(), disturbances=(push,)))
    flight.step(command(ARM, 1.0))
    held = flight.sim.truth().p_WE
    farthest = 0.0
    for _ in range(3500):
        flight.step()
        farthest = max(farthest, math.dist(flight.sim.truth().p_WE, held))
    assert flight.mode is Mode.HOLD
    assert flight.sim.ended is None
    assert farthest > felt, "or it was no test"
    assert math.dist(flight.sim.truth().p_WE, held) < 0.02


@pytest.mark.requirement("REQ-SAFE-10")
def test_a_person_who_is_announced_no_longer_is_told_of_once_and_stands_until_heard_again() -> None:
    config = flight_config(body="points")
    config = replace(config, limits=replace(config.limits, zone_timeout_us=500_000))
    flight = Flight(hover(), config=config)
    source = MessageSource(1, 195, "simulator")

    def announce() -> None:
        at = vertical_cylinder((3.0, 0.0), 0.3, -1.8, 0.0)
        person = Zone(at, 0.1, velocity=(0.0, 0.5, 0.0), t_us=flight.sim.t_us)
        flight.streamed = {"announced": (SafeSetAnnouncement(source, SafeSet((person,))),)}

    def where() -> tuple[float, float]:
        (zone,) = flight.state.mission.safe_set.zones
        return zone.shape.numbers[1], zone.velocity[1]

    flight.step(command(ARM, 1.0))
    text = f"{Condition.ZONES_SILENT.value}: 1 held where predicted"
    for round_ in (1, 2):
        announce()
        flight.run(0.4)
        assert where() == (0.0, 0.5)
        flight.run(0.8)
        assert where() == (pytest.approx(0.25), 0.0)
        assert flight.texts.count(text) == round_
