"""What the plan expects and what the plant does are the same motion, in every direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.control.pid import PidGains
from fsw.autopilot.model.nominal import NominalModel
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.signals import (
    Plan,
    PlanInput,
    PlanRequest,
    PlanTimings,
    PredictionState,
    SolverStatus,
    StateEstimate,
    Vec3,
)
from tests.closed_loop.harness import ARM, Flight, command, hover

SECONDS = 1.0
DIRECTIONS: dict[str, Vec3] = {
    "north": (0.4, 0.0, 0.0),
    "south": (-0.4, 0.0, 0.0),
    "east": (0.0, 0.4, 0.0),
    "west": (0.0, -0.4, 0.0),
    "down": (0.0, 0.0, 0.4),
    "up": (0.0, 0.0, -0.4),
}


class OneInput:
    """A planner that always commands the same acceleration."""

    def __init__(self, a: Vec3) -> None:
        self._u = PlanInput(a, 0.0, (0.0, 0.0))

    def plan(self, request: PlanRequest) -> Plan:
        return Plan(
            plan_id=request.plan_id,
            t_us=request.t_apply_us,
            period_us=100_000,
            start=request.start,
            inputs=(self._u,) * 5,
            status=SolverStatus.SOLVED,
            cost=0.0,
            slack_max=0.0,
            barrier=(),
            sqp_iterations=1,
            solver_iterations=1,
            timings=PlanTimings(0.0, 0.0, 0.0),
        )


def moved(flight: Flight) -> tuple[Array, Array]:
    """How far the plant went, and how far the prediction says it goes."""
    start = np.array(flight.sim.truth().p_WB)
    flight.step(command(ARM, 1.0))
    estimate = flight.snapshot.estimate
    flight.run(SECONDS)
    plan = flight.snapshot.plan
    assert plan is not None
    config = flight.config
    model = NominalModel(config.airframe, 1e-6 * config.tick_period_us)
    first_us = estimate.t_us + config.plan_delay_ticks * config.tick_period_us
    ticks = (flight.sim.t_us - first_us) // config.tick_period_us
    end = model.advance(at_rest(estimate), plan.inputs[0], ticks)
    return np.array(flight.sim.truth().p_WB) - start, np.array(end.p) - start


def at_rest(estimate: StateEstimate) -> PredictionState:
    still: Vec3 = (0.0, 0.0, 0.0)
    return PredictionState(
        estimate.p_WB,
        still,
        still,
        (0.0, 0.0),
        (0.0, 0.0),
        estimate.yaw,
        0.0,
        estimate.q_arm,
        (0.0, 0.0),
    )


@pytest.mark.parametrize("a", DIRECTIONS.values(), ids=DIRECTIONS.keys())
@pytest.mark.parametrize("yaw_deg", [pytest.param(0.0, marks=pytest.mark.long), 120.0])
def test_the_papers_attitude_loop_alone_moves_the_plant_as_predicted(
    a: Vec3, yaw_deg: float
) -> None:
    """No position feedback: acceleration in, attitude loop and rotors, motion out."""
    flight = Flight(hover((0.0, 0.0), yaw_deg), config=open_loop(), planner=OneInput(a))
    plant, predicted = moved(flight)
    assert np.linalg.norm(predicted) > 0.05
    np.testing.assert_allclose(plant, predicted, atol=0.02 * float(np.linalg.norm(predicted)))


@pytest.mark.parametrize("a", DIRECTIONS.values(), ids=DIRECTIONS.keys())
def test_the_tracking_loop_keeps_the_plant_on_its_plan(a: Vec3) -> None:
    plant, predicted = moved(Flight(hover(), planner=OneInput(a)))
    assert np.linalg.norm(predicted) > 0.05
    np.testing.assert_allclose(plant, predicted, atol=2e-3)


def open_loop() -> FlightConfig:
    """The PID inner loop with the gains of the prediction and nothing else.

    Height has no loop either: its thrust is the plan's acceleration fed forward.
    """
    config = flight_config(inner="pid", body="points")
    lag = config.airframe.attitude_lag
    tuning = replace(
        config.tuning,
        attitude=PidGains(lag.kp, 0.0, lag.kd, 25.0),
        height=PidGains(0.0, 0.0, 0.0, 1.0),
    )
    return replace(config, tuning=tuning)
