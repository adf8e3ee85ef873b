"""Flights with ticks as one compiled call are the flights of the stack, to the last bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace as with_fields
from functools import partial
from typing import Any

import numpy as np
import pytest

from fsw.flight.autopilot import Autopilot
from fsw.flight.conditions import Condition
from fsw.flight.quiet_ticks import READINGS
from fsw.flight.state import AIDED, FlightState
from fsw.frozen import replace
from fsw.mpc.planner import Planner
from fsw.parameters.flight_config import flight_config
from fsw.shapes.zones import NO_ZONES
from fsw.signals import Mode, TickInputs, TickOutputs
from sitl.disturbances.items import Uniform
from sitl.faults.keys import Fault
from sitl.scenario_file import load_scenario
from sitl.simulation import Controls, Simulation
from studies.flight.closed_loop import (
    FIRST_COMMANDS,
    ClosedLoop,
    InlinePlanner,
    QuietStretch,
    simulate,
)
from studies.flight.result import FlightResult

in_long = partial(pytest.param, marks=pytest.mark.long)
Sent = list[Controls]


def flown(
    monkeypatch: pytest.MonkeyPatch, name: str, seconds: float, *, quiet: bool, push: float = 0.0
) -> tuple[FlightResult, Sent, int]:
    """A flight, what was commanded in each step, and how many ticks were whole ones."""
    scenario = with_fields(load_scenario(name), duration_s=seconds)
    if push > 0.0:
        scenario = with_fields(scenario, disturbances=(Uniform(push, 0.1),))
    sent, whole = Sent(), 0
    advance, tick = Simulation.advance, Autopilot.tick

    def noted(self: Simulation, controls: Controls) -> None:
        sent.append(controls)
        advance(self, controls)

    def counted(
        self: Autopilot, state: FlightState, inputs: TickInputs
    ) -> tuple[FlightState, TickOutputs]:
        nonlocal whole
        whole += 1
        return tick(self, state, inputs)

    with monkeypatch.context() as patched:
        patched.setattr(Simulation, "advance", noted)
        patched.setattr(Autopilot, "tick", counted)
        if not quiet:
            patched.setattr(QuietStretch, "fly", lambda self: self._loop.simulation.ended is None)
        result = simulate(scenario, 7, flight_config(body=scenario.body))
    return result, sent, whole


@pytest.mark.drawn(2)
@pytest.mark.parametrize(
    ("name", "seconds", "push", "most_whole"),
    [
        ("walls", 4.0, 0.0, 0.12),
        in_long("workspace", 3.0, 0.0, 0.12),
        ("branches", 3.0, 0.0, 0.12),
        in_long("walls-calm", 3.0, 0.0, 0.08),
        ("crossing", 3.0, 0.0, 1.0),
        # Pushed off its plan, filtered, saturated, replanned, and retreating in the end.
        ("walls", 4.0, 3.0, 1.0),
        in_long("workspace", 3.0, 3.0, 1.0),
    ],
)
def test_the_flight_is_the_same_to_the_last_bit(
    monkeypatch: pytest.MonkeyPatch, name: str, seconds: float, push: float, most_whole: float
) -> None:
    plain, commanded, every = flown(monkeypatch, name, seconds, quiet=False, push=push)
    result, sent, whole = flown(monkeypatch, name, seconds, quiet=True, push=push)
    assert every == len(commanded)
    assert whole < most_whole * every
    assert sent == commanded
    assert result.truth == plain.truth
    assert result.planner.texts == plain.planner.texts
    assert result.planner.modes == plain.planner.modes
    assert result.planner.metrics.as_json() == plain.planner.metrics.as_json()


class Before:
    """A flight that has just had a whole tick, and may have quiet ones."""

    def __init__(self) -> None:
        scenario = load_scenario("walls-calm")
        self.autopilot = Autopilot(flight_config(body=scenario.body))
        self.simulation = Simulation(scenario, 0)
        config = self.autopilot.config
        planner = InlinePlanner(Planner(config.planner, config.airframe, lambda: 0.0))
        loop = ClosedLoop(
            self.simulation, self.autopilot.tick, FlightState(), planner, config.airframe
        )
        for step in range(61):
            sensors = loop.sense()
            loop.step(
                TickInputs(
                    sensors=sensors,
                    plan=planner.take(sensors.t_us),
                    commands=FIRST_COMMANDS[step] if step < 2 else (),
                    targets=loop.targets(),
                    announced=loop.announced(),
                )
            )
        self.state = loop.state
        self.reading = np.empty(READINGS)
        self.simulation.exact_state(self.reading)
        self.ticks = self.autopilot.quiet_ticks()


@pytest.fixture(scope="module")
def before() -> Before:
    """Shared by tests that change nothing of it."""
    return Before()


def test_after_a_whole_tick_quiet_ones_follow_up_to_the_next_planning_period(
    before: Before,
) -> None:
    state = before.state
    assert state.index % 50 == 10
    assert before.ticks.begin(state, before.autopilot.zones_now(state)) == 39


CHANGES: dict[str, Callable[[FlightState], FlightState]] = {
    "another mode": lambda s: replace(s, vehicle=replace(s.vehicle, mode=Mode.HOLD)),
    "a condition": lambda s: replace(
        s, vehicle=replace(s.vehicle, conditions=(Condition.BATTERY_LOW,))
    ),
    "off the plan": lambda s: replace(s, safety=replace(s.safety, off_plan_us=s.t_us)),
    "a filtered tick": lambda s: replace(s, safety=replace(s.safety, filter_us=s.t_us)),
    "a breach": lambda s: replace(s, safety=replace(s.safety, breach_us=s.t_us)),
    "a rotor": lambda s: replace(s, damage=s.damage._replace(rotor="rotor 1 gives nothing")),
    "a joint": lambda s: replace(s, damage=s.damage._replace(joint="joint 1 does not move")),
    "a pose that is missing": lambda s: replace(s, aiding=AIDED._replace(unaided_us=2000)),
    "no plan": lambda s: replace(s, plan=replace(s.plan, running=None)),
    "a plan that was refused": lambda s: replace(s, plan=replace(s.plan, refused=True)),
    "a plan that is due": lambda s: replace(
        s, plan=replace(s.plan, awaited_id=9, awaited_us=s.t_us + 2000)
    ),
    "no more targets": lambda s: replace(s, mission=replace(s.mission, stream=())),
}


@pytest.mark.parametrize("what", CHANGES)
def test_no_tick_is_quiet_while_something_goes_on(before: Before, what: str) -> None:
    state = CHANGES[what](before.state)
    assert before.ticks.begin(state, NO_ZONES) == 0
    assert before.ticks.end(state) is state


READING: dict[str, Callable[[Any], None]] = {
    "a place that is none": lambda r: r.__setitem__(0, np.nan),
    "a place beyond all range": lambda r: r.__setitem__(1, 1e6),
    "a rate that is none": lambda r: r.__setitem__(10, np.inf),
    "off the plan": lambda r: r.__setitem__(2, r[2] + 0.09),
    "on its back": lambda r: r.__setitem__(slice(6, 10), (0.0, 1.0, 0.0, 0.0)),
    "a joint rate out of range": lambda r: r.__setitem__(18, 200.0),
}


@pytest.mark.parametrize("what", READING)
def test_a_reading_that_has_to_be_looked_at_ends_the_quiet_ticks(before: Before, what: str) -> None:
    zones = before.autopilot.zones_now(before.state)
    assert before.ticks.begin(before.state, zones) > 0
    assert before.ticks.tick(before.reading)[0]
    flown_once = before.ticks.end(before.state)
    bad = before.reading.copy()
    READING[what](bad)
    assert not before.ticks.tick(bad)[0]
    after = before.ticks.end(before.state)
    assert after.index == before.state.index + 1
    assert after.estimate == flown_once.estimate
    assert after.cascade == flown_once.cascade


def test_where_sensors_fail_no_tick_is_quiet() -> None:
    scenario = load_scenario("walls-calm")
    fault = Fault("motor", "weak", start_s=1.0)
    assert Simulation(scenario, 0).tells_its_state
    assert not Simulation(with_fields(scenario, faults=(fault,)), 0).tells_its_state
    injected = Simulation(scenario, 0)
    injected.inject(fault)
    assert not injected.tells_its_state
