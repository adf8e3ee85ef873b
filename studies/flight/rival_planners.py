"""The planners that the paper compares its own with: the same program, with other parts in it.

==========  =====================================  ==========================================
name        Case I, walls; and points              Case II, workspace sphere
==========  =====================================  ==========================================
``naive``   tracking cost only                     tracking cost only
``hc``      distances >= 0 (eq 14)                 distance to the surface >= 0 (eq 15)
``sc``      cost of eq 29                          cost of eq 30
==========  =====================================  ==========================================

Any other zone to keep out of or in is treated as a wall is, by the plane near each probe.

Naive can be given a centring cost and HC a tightening, so that the barrier's own share in a
comparison shows (docs/reference/paper-comparison.md). With them comes the paper's optimiser. What
is imported here the planner knows by name.
"""

from __future__ import annotations

from dataclasses import replace

from fsw.autopilot.barriers.zone_rows import ZoneRows
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.prediction import CondensedModel
from fsw.autopilot.mpc.costs import Cost, TrackingCost
from fsw.autopilot.mpc.optimisers import OPTIMISERS
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.variants import VARIANTS, OcpTerms
from fsw.autopilot.shapes import kind_of
from fsw.autopilot.signals import SafeSet, Zone
from studies.flight.slsqp_solver import by_slsqp
from studies.flight.soft_costs import SphereCost, ZoneCost


def _naive(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    costs: tuple[Cost, ...] = (TrackingCost(config.weights),)
    weight = config.soft.centring
    if config.centred:
        spheres, _ = _split(safe_set)
        centring = (weight, 5.0 * weight)
        costs += tuple(SphereCost(one, centring, only_outside=False) for one in spheres)
    return OcpTerms(costs, follows_zones=False)


def _hard(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    costs = (TrackingCost(config.weights),)
    if not safe_set.zones:
        return OcpTerms(costs)
    rows = ZoneRows(
        safe_set,
        body_of(config.body, model.airframe),
        model,
        config.tunings,
        distances=True,
        tightening=config.tightening,
        skipped_nodes=config.hard_skipped_nodes,
        most=config.limits.most,
    )
    if not config.hard_terminal:
        return OcpTerms(costs, (rows,), config.hard_slack)
    return OcpTerms(costs, (rows, _terminal(config, model, safe_set)), config.hard_slack)


def _terminal(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> ZoneRows:
    """``h >= 0`` at the last node alone, with the tightening: from there braking suffices."""
    # At gamma T = 1 nothing is left of the h at the start, and lambda is what is required.
    wall, workspace = (
        replace(
            tuning,
            gamma=1.0 / config.period,
            lambda_=max(tuning.slope * config.tightening, 1e-6),
            skipped_nodes=config.horizon - 1,
        )
        for tuning in config.tunings
    )
    body = body_of(config.body, model.airframe)
    return ZoneRows(safe_set, body, model, (wall, workspace), most=config.limits.most)


def _soft(config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> OcpTerms:
    costs: tuple[Cost, ...] = (TrackingCost(config.weights),)
    spheres, others = _split(safe_set)
    weights = (config.soft.workspace, config.soft.workspace_terminal)
    costs += tuple(SphereCost(one, weights, only_outside=True) for one in spheres)
    if others.zones:
        # Every distance has its cost, also one that no input could make a bound.
        body = body_of(config.body, model.airframe)
        distances = ZoneRows(others, body, model, config.tunings, distances=True, skipped_nodes=0)
        costs += (ZoneCost(distances, config.soft),)
    return OcpTerms(costs, follows_zones=False)


def _split(safe_set: SafeSet) -> tuple[tuple[Zone, ...], SafeSet]:
    """The spheres that follow the target, and everything else."""
    follows = [kind_of(zone.shape).follows_target for zone in safe_set.zones]
    pairs = list(zip(safe_set.zones, follows, strict=True))
    spheres = tuple(zone for zone, it_follows in pairs if it_follows)
    return spheres, SafeSet(tuple(zone for zone, it_follows in pairs if not it_follows))


VARIANTS.update(naive=_naive, hc=_hard, sc=_soft)
OPTIMISERS["slsqp"] = by_slsqp
