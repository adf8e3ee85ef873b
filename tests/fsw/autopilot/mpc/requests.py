"""Questions for a planner."""

from __future__ import annotations

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.signals import (
    EndEffectorTarget,
    Plan,
    PlanFailure,
    PlanRequest,
    PredictionState,
    SafeSet,
    Vec3,
)

STILL: Vec3 = (0.0, 0.0, 0.0)
PERIOD_US = 100_000


def planner(config: PlannerConfig | None = None) -> Planner:
    return Planner(config or PlannerConfig(body="points"), AIRFRAME, stopwatch_us=lambda: 0.0)


def hovering(p: Vec3 = (0.0, 0.0, -1.2)) -> PredictionState:
    """At rest, arm straight down: the end-effector is 0.3 m below p."""
    return PredictionState(
        p, STILL, STILL, (0.0, 0.0), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0), (0.0, 0.0)
    )


def below(p: Vec3, depth: float = 0.3) -> EndEffectorTarget:
    return EndEffectorTarget(0, (p[0], p[1], p[2] + depth), STILL, STILL)


def request(
    start: PredictionState,
    target: EndEffectorTarget,
    safe_set: SafeSet | None = None,
    t_us: int = 1_000_000,
) -> PlanRequest:
    """The same target at every node of the default horizon."""
    return PlanRequest(7, t_us, start, (target,) * 6, safe_set or SafeSet(), False)


def planned(answer: Plan | PlanFailure) -> Plan:
    """The answer, which must be a plan."""
    assert isinstance(answer, Plan), answer
    return answer
