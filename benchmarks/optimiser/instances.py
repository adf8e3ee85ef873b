"""What the planner is asked in flight: requests recorded in the closed loop of both cases."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fsw.autopilot.model.prediction import inputs_of, states_of
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import PlanRequest
from studies.flight.closed_loop import simulate
from studies.paper.cases import CASES, Case, configuration, scenario, with_horizon

STATES, INPUTS = states_of(2), inputs_of(2)  # of paper, whose all these requests are
SEED = 100  # never used for tuning
# 0.1 s ahead the lagging vehicle can hardly be moved: with n = 1 it hits the first wall. Shorter
# horizons are asked about the flight of this one.
_FLYABLE = 5
_LED_BY = 2  # requests before the timed one: they bring a planner's guess to where it is in flight


@dataclass(frozen=True, slots=True)
class Instance:
    """One question and the two that came before it, a period apart each."""

    case: Case
    before: tuple[PlanRequest, ...]
    request: PlanRequest


def planner_of(horizon: int) -> FlightConfig:
    """The configuration that is recorded and timed: ``blf`` as it flies, another horizon."""
    return with_horizon(configuration("full"), horizon)


def record(horizon: int, count: int, duration_s: float) -> list[Instance]:
    """Instances spread evenly over a flight of each case, cases alternating.

    Args:
        horizon: n.
        count: Of instances for each case; fewer if the flight is too short.
        duration_s: Of the flights.
    """
    by_case = [_of_case(case, horizon, count, duration_s) for case in CASES]
    return [instance for pair in zip(*by_case, strict=False) for instance in pair]


def _of_case(case: Case, horizon: int, count: int, duration_s: float) -> list[Instance]:
    heard: list[PlanRequest] = []
    flown = scenario(case, disturbed=True, duration_s=duration_s)
    simulate(flown, SEED, planner_of(max(horizon, _FLYABLE)), asked=heard.append)
    requests = [replace(request, targets=request.targets[: horizon + 1]) for request in heard]
    last = len(requests) - 1
    chosen = np.unique(np.linspace(min(_LED_BY + 10, last), last, count).astype(int))
    return [
        Instance(case, tuple(requests[at - _LED_BY : at]), requests[at])
        for at in chosen
        if at >= _LED_BY
    ]
