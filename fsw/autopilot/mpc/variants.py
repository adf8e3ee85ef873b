"""The controllers by name: what each puts into the planner's program.

``blf`` is the paper's and ours: the barrier of eq 22, and of eq 23 in the workspace sphere, with
eq 25. Any other zone to keep out of or in is treated as a wall is, by the plane near each probe.
Those that it is compared with are known once ``studies.flight.rival_planners`` is imported.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from fsw.autopilot.barriers.zone_rows import ZoneRows
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.prediction import CondensedModel
from fsw.autopilot.mpc.costs import Cost, PostureCost, TrackingCost
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.signals import SafeSet


@dataclass(frozen=True)
class OcpTerms:
    """What shapes the optimum of one controller in one safe set."""

    costs: tuple[Cost, ...]
    barriers: tuple[ZoneRows, ...] = ()
    slack: float | None = None  # penalty of softening their rows; None: they are hard
    follows_zones: bool = True  # False: costs hold the numbers of zones, and are made anew


def _blf(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    weights, body = config.weights, body_of(config.body, model.airframe)
    if safe_set.touchable:
        weights = replace(weights, arm_com=0.0, arm_com_terminal=0.0)
    costs = (TrackingCost(weights),)
    if not safe_set.zones:
        return OcpTerms(costs)
    barrier = ZoneRows(
        safe_set,
        body,
        model,
        config.tunings,
        most=config.limits.most,
        least_lambda=config.lambda_min,
    )
    return OcpTerms(costs, (barrier,), config.weights.scale * config.barrier_slack)


VARIANTS: dict[str, Callable[[PlannerConfig, CondensedModel, SafeSet], OcpTerms]] = {"blf": _blf}


def parts_of(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    """The terms of the configured controller, and the cost of requested joints."""
    parts = VARIANTS[config.controller](config, model, safe_set)
    posture = PostureCost(config.weights, model.airframe, touches=safe_set.touchable)
    return replace(parts, costs=(*parts.costs, posture))
