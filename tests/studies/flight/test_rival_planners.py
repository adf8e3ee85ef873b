"""The four controllers: which costs and rows each has in which safe set."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.barriers.zone_rows import ZoneRows
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import condense
from fsw.autopilot.mpc.costs import PostureCost, TrackingCost
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.variants import parts_of
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import SafeSet
from studies.flight.rival_planners import VARIANTS, SphereCost, ZoneCost
from tests.fsw.autopilot.mpc.quadratics import quadratic
from tests.fsw.paper_arm import INPUTS

CONFIG = PlannerConfig(body="points")
N = CONFIG.horizon
MODEL = condense(AIRFRAME, CONFIG.period, N)
WALL, POINT = wall((-1.0, 0.0, 0.0), -1.0, 0.1), point((0.2, 0.1, 0.3), 0.15)
SPHERE = target_sphere((0.0, 0.0, -0.225), 0.075)
SETS = {
    "open": SafeSet(),
    "walls": SafeSet((WALL,)),
    "points": SafeSet((POINT,)),
    "both": SafeSet((WALL, POINT)),
    "sphere": SafeSet((SPHERE,)),
    "all": SafeSet((WALL, SPHERE, POINT)),
}
SOFT = {
    "open": (),
    "walls": (ZoneCost,),
    "points": (ZoneCost,),
    "both": (ZoneCost,),
    "sphere": (SphereCost,),
    "all": (SphereCost, ZoneCost),
}


@pytest.mark.parametrize("where", SETS)
@pytest.mark.parametrize("controller", VARIANTS)
def test_each_controller_has_the_parts_of_the_table(controller: str, where: str) -> None:
    config = replace(CONFIG, controller=controller, barrier_slack=21.0, hard_slack=None)
    parts = parts_of(config, MODEL, SETS[where])
    costs = (TrackingCost, *(SOFT[where] if controller == "sc" else ()), PostureCost)
    rows = (ZoneRows,) if controller in ("hc", "blf") and where != "open" else ()
    assert tuple(map(type, parts.costs)) == costs
    assert tuple(map(type, parts.barriers)) == rows
    assert parts.slack == (21.0 if controller == "blf" and rows else None)


@pytest.mark.parametrize("where", ["walls", "points", "sphere"])
def test_the_rows_of_hc_can_be_tightened_softened_and_begin_later(where: str) -> None:
    config = replace(
        CONFIG, controller="hc", hard_slack=30.0, tightening=0.04, hard_skipped_nodes=2
    )
    parts = parts_of(config, MODEL, SETS[where])
    (barrier,) = parts.barriers
    assert isinstance(barrier, ZoneRows)
    assert (barrier.rows.node.min(), barrier.rows.node.max()) == (3, N)
    guess = np.zeros(INPUTS * N)
    horizon = Linearisation(MODEL)
    horizon.refill(np.zeros(19), guess)
    barrier.refill(
        horizon, TargetPoints(np.zeros((N + 1, 3)), np.zeros((N + 1, 3)), np.zeros(N + 1))
    )
    bound = barrier.rows.gradient.any(axis=1)  # the others are left out
    assert bound.any()
    assert (barrier.rows.lower_bound[bound] == 0.04).all()
    assert parts.slack == 30.0
    (usual,) = parts_of(replace(CONFIG, controller="hc"), MODEL, SETS[where]).barriers
    assert usual.rows.node.min() == 1


def cost_of(controller: str, off: float, *, centred: bool = False) -> float:
    """What the sphere costs where the base is ``off`` [m] its centre at every node."""
    config = replace(CONFIG, controller=controller, centred=centred)
    config = replace(
        config,
        soft=replace(config.soft, workspace=3.0, workspace_terminal=40.0, centring=100.0),
    )
    _, cost, _ = parts_of(config, MODEL, SETS["sphere"]).costs
    guess, horizon = np.zeros(INPUTS * N), Linearisation(MODEL)
    horizon.refill(np.zeros(19), guess)
    place = horizon.states[:, :3] - np.array(SPHERE.shape.numbers[:3]) + [off, 0.0, 0.0]
    targets = TargetPoints(place, np.zeros((N + 1, 3)), np.zeros(N + 1))
    return quadratic(cost, horizon, guess, targets)[0]


@pytest.mark.long
def test_the_sphere_of_sc_costs_outside_alone_and_most_at_the_end() -> None:
    assert cost_of("sc", 0.074) == 0.0
    assert cost_of("sc", 0.1) == pytest.approx(0.01 * (3.0 * (N - 1) + 40.0))


def test_centring_costs_everywhere_and_five_times_at_the_end() -> None:
    assert cost_of("naive", 0.01, centred=True) == pytest.approx(1e-4 * 100.0 * (N - 1 + 5))


def test_centring_is_of_a_sphere_and_only_where_it_is_asked_for() -> None:
    centred = replace(CONFIG, controller="naive", centred=True)
    assert len(parts_of(centred, MODEL, SETS["walls"]).costs) == 2
    assert len(parts_of(replace(centred, centred=False), MODEL, SETS["sphere"]).costs) == 2


@pytest.mark.parametrize("where", ["walls", "points"])
def test_the_surfaces_of_sc_count_from_the_clearance_and_from_the_first_node(where: str) -> None:
    config = replace(CONFIG, controller="sc", tightening=0.3, hard_skipped_nodes=3)
    changed, usual = (
        parts_of(each, MODEL, SETS[where]).costs[1]
        for each in (config, replace(CONFIG, controller="sc"))
    )
    guess, horizon = np.zeros(INPUTS * N), Linearisation(MODEL)
    horizon.refill(np.zeros(19), guess)
    targets = TargetPoints(np.zeros((N + 1, 3)), np.zeros((N + 1, 3)), np.zeros(N + 1))
    values = [quadratic(cost, horizon, guess, targets)[0] for cost in (changed, usual)]
    assert values[0] == values[1] > 0.0


@pytest.mark.parametrize("where", ["walls", "sphere"])
def test_a_terminal_set_asks_of_the_last_node_alone_that_braking_suffices(where: str) -> None:
    config = replace(CONFIG, controller="hc", tightening=0.05, hard_terminal=True)
    distances, ends = parts_of(config, MODEL, SETS[where]).barriers
    assert isinstance(distances, ZoneRows)
    assert isinstance(ends, ZoneRows)
    assert distances.rows.node.min() == 1
    assert set(ends.rows.node) == {N}
    start, guess = np.zeros(19), np.zeros(INPUTS * N)
    start[0], start[3] = 0.5, 0.9  # towards the wall, and out of the sphere
    horizon = Linearisation(MODEL)
    horizon.refill(start, guess)
    ends.refill(horizon, TargetPoints(np.zeros((N + 1, 3)), np.zeros((N + 1, 3)), np.zeros(N + 1)))
    bound = ends.rows.gradient.any(axis=1)
    assert bound.any()
    # At rest that is the distance of the tightening, whatever h was at the start.
    slope = CONFIG.walls.slope if where == "walls" else CONFIG.workspace.slope
    assert ends.rows.lower_bound[bound] == pytest.approx(slope * 0.05)
