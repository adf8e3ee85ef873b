"""Each row of the wall barrier against h of eq 22, measured along the predicted motion."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.barriers.safe_approach import BarrierTuning
from fsw.autopilot.barriers.zone_rows import ZoneRows
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import Zone
from tests.fsw.autopilot.barriers.horizons import (
    NODES,
    Case,
    barrier_of,
    front_of,
    lowest_allowed,
    measured,
    random_case,
    safe_speed,
)
from tests.fsw.paper_arm import INPUTS
from tests.fsw.random_states import vec3

STEP = 1e-4
LEVEL = (wall((-1.0, 0.0, 0.0), -1.0, 0.1), wall((0.0, 1.0, 0.0), -1.0, 0.1))
SLANTED = (wall((0.48, -0.6, 0.64), -1.0, 0.1),)


def random_walls(random: np.random.Generator, through: Array, distance: float) -> tuple[Zone, ...]:
    """Two walls at this distance (clearance taken off) from a point."""
    walls = []
    for clearance in (0.1, 0.0):
        normal = random.standard_normal(3)
        normal /= np.linalg.norm(normal)
        offset = float(normal @ through) - distance - clearance
        walls.append(wall(vec3(normal), offset, clearance))
    return tuple(walls)


def braked(walls: tuple[Zone, ...], horizon: Linearisation, first_node: int) -> Array:
    """What h is for: the speed that can still be braked, plus the rate at which distance grows.

    Distances and rates are those of the points measured along the motion, in the rows' order.
    """
    position, velocity = measured(horizon)
    values = []
    for node in range(first_node, NODES + 1):
        for one in walls:
            normal, offset = front_of(one)
            for point in range(3):
                distance = position[node, point] @ normal - offset
                values.append(safe_speed(distance) + velocity[node, point] @ normal)
    return np.array(values)


def refilled(walls: tuple[Zone, ...], case: Case) -> ZoneRows:
    barrier = barrier_of(walls)
    barrier.refill(case.horizon(), case.targets)
    return barrier


@pytest.mark.parametrize("distance", [0.5, 0.0, -0.3], ids=["inside", "on the plane", "outside"])
def test_rows_equal_h_and_its_finite_difference_along_the_prediction(distance: float) -> None:
    random = np.random.default_rng(1)
    case = random_case(random)
    walls = random_walls(random, case.start[0:3], distance)
    rows = refilled(walls, case).rows
    np.testing.assert_allclose(rows.value, braked(walls, case.horizon(), 2), atol=1e-5)
    for column in range(INPUTS * NODES):
        change = np.zeros(INPUTS * NODES)
        change[column] = STEP
        above = braked(walls, case.horizon(change), 2)
        below = braked(walls, case.horizon(-change), 2)
        np.testing.assert_allclose(
            rows.gradient[:, column], (above - below) / (2 * STEP), atol=1e-4
        )


def test_rows_ask_for_what_the_decay_from_the_start_leaves() -> None:
    random = np.random.default_rng(2)
    case = random_case(random)
    walls = random_walls(random, case.start[0:3], 0.4)
    barrier = refilled(walls, case)
    start = braked(walls, case.horizon(), 0)[: 3 * len(walls)]
    np.testing.assert_allclose(barrier.rows.start, start, atol=1e-5)
    expected = [lowest_allowed(h, node) for node in range(2, NODES + 1) for h in start]
    np.testing.assert_allclose(barrier.rows.lower_bound, expected, atol=1e-5)


def test_each_node_and_wall_has_a_slack_of_its_own() -> None:
    walls = (wall((1.0, 0.0, 0.0), 0.0, 0.1), wall((0.0, 1.0, 0.0), 0.0, 0.1))
    rows = barrier_of(walls).rows
    shared = {(int(node), k // 3 % 2): int(rows.slack[k]) for k, node in enumerate(rows.node)}
    assert len(set(shared.values())) == len(shared) == rows.slacks == 2 * (NODES - 1)


def test_skipped_nodes_have_no_rows() -> None:
    case = random_case(np.random.default_rng(3))
    barrier = barrier_of(LEVEL, BarrierTuning(skipped_nodes=2))
    barrier.refill(case.horizon(), case.targets)
    assert barrier.rows.node.min() == 3


@pytest.mark.parametrize("walls", [LEVEL, SLANTED], ids=["along the axes", "slanted"])
def test_no_row_feels_an_input_from_its_node_on(walls: tuple[Zone, ...]) -> None:
    random = np.random.default_rng(4)
    for _ in range(10):
        rows = refilled(walls, random_case(random)).rows
        later = np.arange(rows.gradient.shape[1]) >= INPUTS * rows.node[:, None]
        assert not rows.gradient[later].any()
        assert rows.gradient[~later].any()


def test_accelerating_away_from_the_wall_raises_h() -> None:
    case = random_case(np.random.default_rng(4))
    case.start[:] = 0.0
    ahead = (wall((-1.0, 0.0, 0.0), -1.0, 0.1),)  # plane x = 1, free space behind it
    rows = refilled(ahead, case).rows
    base_last_node = len(rows.node) - 3
    assert rows.gradient[base_last_node, 0] < 0.0  # forward is towards the wall
    assert rows.gradient[base_last_node, 1] == 0.0
