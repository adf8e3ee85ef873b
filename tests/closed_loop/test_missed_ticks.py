"""Sensor frames that never arrive: the plan keeps its time, and planning its period."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.state import FlightState, first_state
from fsw.autopilot.model.nominal import NominalModel
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import (
    EndEffectorTarget,
    Mode,
    Plan,
    PlanRequest,
    SensorFrame,
    TickInputs,
)
from tests.closed_loop.harness import Flight, command, hover

CONFIG = flight_config(body="points")
START_US = 1_000_000
ARM = command(400, 1.0)
TRAJECTORY = command(176, 1.0, 4.0, 11.0)
ARM_FOLDED = (-0.7227, 1.4454)


def frame(t_us: int) -> SensorFrame:
    """A vehicle that is held still, so that only the plan moves."""
    return SensorFrame(
        t_us, (0.0, 0.0, -2.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0, 0.0, -9.81),
        ARM_FOLDED, (0.0, 0.0),
    )  # fmt: skip


def target(t_us: int) -> EndEffectorTarget:
    """Half a metre ahead of where the end-effector is."""
    return EndEffectorTarget(t_us, (0.1, 0.0, -1.775), (0.0,) * 3, (0.0,) * 3)


def fly(lost: set[int], ticks: int) -> tuple[FlightState, list[PlanRequest]]:
    """Ticks of a loop that never hears the lost ones; plans arrive when they are due."""
    loop, state = Autopilot(CONFIG), first_state(CONFIG.airframe)
    planner = Planner(CONFIG.planner, CONFIG.airframe, lambda: 0.0)
    waiting: Plan | None = None
    asked = []
    for k in range(ticks):
        if k in lost:
            continue
        t_us = START_US + k * CONFIG.tick_period_us
        plan = waiting if waiting is not None and waiting.t_us <= t_us else None
        waiting = None if plan is not None else waiting
        first = k == 0
        inputs = TickInputs(
            frame(t_us),
            plan,
            (ARM, TRAJECTORY) if first else (),
            tuple(target(START_US + i * 100_000) for i in range(30)) if first else (),
        )
        state, outputs = loop.tick(state, inputs)
        assert outputs.snapshot.mode is Mode.TRAJECTORY, outputs.texts
        if outputs.plan_request is not None:
            asked.append(outputs.plan_request)
            answer = planner.plan(outputs.plan_request)
            assert isinstance(answer, Plan)
            waiting = answer
    return state, asked


@pytest.mark.requirement("REQ-TIME-3")
@pytest.mark.parametrize("lost", [{30}, {30, 31, 32}, set(range(20, 40))])
def test_the_plan_s_state_is_where_it_would_be_without_the_loss(lost: set[int]) -> None:
    whole, _ = fly(set(), 140)
    holed, _ = fly(lost, 140)
    assert whole.plan_state is not None
    assert whole.plan_state == holed.plan_state
    assert math.dist(whole.plan_state.p, (0.0, 0.0, -2.0)) > 1e-3, "it moves"


@pytest.mark.parametrize("lost", [{49, 50, 51}, {100}])
def test_a_loss_of_the_planning_tick_costs_a_hundredth_of_a_millimetre(lost: set[int]) -> None:
    """The next plan is another one; without the missed steps the state would be 40 um off."""
    whole, _ = fly(set(), 140)
    holed, _ = fly(lost, 140)
    assert whole.plan_state is not None
    assert holed.plan_state is not None
    assert 0.0 < math.dist(whole.plan_state.p, holed.plan_state.p) < 2e-5


def test_a_lost_planning_tick_is_planned_on_the_next_and_the_grid_stays() -> None:
    _, asked = fly({50}, 160)
    applied = [(request.t_apply_us - START_US) // CONFIG.tick_period_us for request in asked]
    delay = CONFIG.plan_delay_ticks
    assert applied == [delay, 51 + delay, 100 + delay, 150 + delay]


def test_without_loss_every_step_is_one_step_of_the_model() -> None:
    state, asked = fly(set(), CONFIG.plan_delay_ticks + 4)
    model = NominalModel(CONFIG.airframe, CONFIG.tick_period_us * 1e-6)
    plan = state.plan.running
    assert plan is not None
    assert len(asked) == 1
    assert state.plan_state == model.advance(plan.start, plan.inputs[0], 3)


def test_no_rotor_or_joint_is_blamed_for_what_stopped_while_no_tick_was_there() -> None:
    """The drives hold the last command for 0.1 s, and are off until the next one."""
    flight = Flight(hover())
    flight.step(command(400, 1.0))
    flight.run(2.0)
    held = flight.closed.controls(flight.sent[-1], armed=True)
    for k in range(125):
        flight.sim.advance(held._replace(armed=k < 50))
    flight.run(3.0)
    assert any("time jumped" in text for text in flight.texts)
    assert not [text for text in flight.texts if "failed" in text]
    assert flight.mode is Mode.HOLD
