"""The paper's four controllers: the same program, with different parts in it.

==========  =====================================  ==========================================
name        Case I, walls; and points              Case II, workspace sphere
==========  =====================================  ==========================================
``naive``   tracking cost only                     tracking cost only
``hc``      distances >= 0 (eq 14)                 distance to the surface >= 0 (eq 15)
``sc``      cost of eq 29                          cost of eq 30
``blf``     barrier of eq 22 with eq 25            barriers of eq 23 with eq 25
==========  =====================================  ==========================================

Points, alone or beside walls, are to ``hc`` and ``sc`` what walls are; ``blf`` has eqs 11 and 12.

Naive can be given a centring cost and HC a tightening, so that the barrier's own share in a
comparison shows (docs/reference/paper-comparison.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from fsw.barriers.constraint_block import Barrier
from fsw.barriers.hard_set import HardObstacles, HardSet, HardWalls, HardWorkspace
from fsw.barriers.point_obstacle import PointObstacleBarrier
from fsw.barriers.wall import WallBarrier
from fsw.barriers.workspace import WorkspaceBarrier
from fsw.model.prediction import CondensedModel
from fsw.mpc.costs import Cost, PostureCost, TrackingCost
from fsw.mpc.planner_config import PlannerConfig
from fsw.mpc.soft_costs import SphereCost, SurfaceCost
from fsw.signals import SafeSet


@dataclass(frozen=True)
class OcpTerms:
    """What shapes the optimum of one controller in one safe set."""

    costs: tuple[Cost, ...]
    barriers: tuple[Barrier, ...] = ()
    slack: float | None = None  # penalty of softening their rows; None: they are hard


def _naive(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    costs: tuple[Cost, ...] = (TrackingCost(config.weights),)
    weight = config.soft.centring
    if config.centred and safe_set.sphere is not None:
        centring = SphereCost(safe_set.sphere, weight, 5.0 * weight, only_outside=False)
        costs = (*costs, centring)
    return OcpTerms(costs)


def _hard(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    costs, first = (TrackingCost(config.weights),), 1 + config.hard_skipped_nodes
    where = (model.horizon, config.tightening, first)
    if safe_set.sphere is not None:
        return OcpTerms(costs, (HardWorkspace(safe_set.sphere, *where),), config.hard_slack)
    return OcpTerms(costs, _surfaces(safe_set, *where), config.hard_slack)


def _surfaces(
    safe_set: SafeSet, horizon: int, tightening: float, first_node: int
) -> tuple[HardSet, ...]:
    """The distances to walls and obstacles, where there are any."""
    surfaces: list[HardSet] = []
    if safe_set.walls:
        surfaces.append(HardWalls(safe_set.walls, horizon, tightening, first_node))
    if safe_set.obstacles:
        surfaces.append(HardObstacles(safe_set.obstacles, horizon, tightening, first_node))
    return tuple(surfaces)


def _soft(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    tracking, weights = TrackingCost(config.weights), config.soft
    if safe_set.sphere is not None:
        outside = SphereCost(
            safe_set.sphere, weights.workspace, weights.workspace_terminal, only_outside=True
        )
        return OcpTerms((tracking, outside))
    surfaces = _surfaces(safe_set, model.horizon, tightening=0.0, first_node=1)
    return OcpTerms((tracking, *(SurfaceCost(each, weights) for each in surfaces)))


def _blf(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    costs = (TrackingCost(config.weights),)
    if safe_set.sphere is not None:
        sphere = WorkspaceBarrier(safe_set.sphere, config.workspace, model)
        return OcpTerms(costs, (sphere,), config.barrier_slack)
    barriers: list[Barrier] = []
    if safe_set.walls:
        barriers.append(WallBarrier(safe_set.walls, config.walls, model))
    if safe_set.obstacles:
        # A point is the wall that its ball's tangent plane is, so it has the walls' tuning.
        obstacles, tuning = safe_set.obstacles, config.walls
        barriers.append(PointObstacleBarrier(obstacles, tuning, model))
    return OcpTerms(costs, tuple(barriers), config.barrier_slack)


VARIANTS: dict[str, Callable[[PlannerConfig, CondensedModel, SafeSet], OcpTerms]] = {
    "naive": _naive,
    "hc": _hard,
    "sc": _soft,
    "blf": _blf,
}


def parts_of(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    """The terms of the configured controller, and the cost of requested joints."""
    parts = VARIANTS[config.controller](config, model, safe_set)
    return replace(parts, costs=(*parts.costs, PostureCost(config.weights)))
