"""MPC-HC's rows are distances: against h = d written out, with gradients by finite differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from fsw.barriers.hard_set import HardObstacles, HardWalls, HardWorkspace

from fsw.model.linearisation import BASE, Linearisation
from fsw.model.prediction import INPUTS, Array
from fsw.signals import PointObstacle, Wall, WorkspaceSphere
from tests.fsw.barriers.horizons import NODES, Case, measured, random_case

WALLS = (Wall((-1.0, 0.0, 0.0), -1.0, 0.1), Wall((0.0, 0.6, 0.8), -1.5, 0.05))
OFFSET = np.array([0.0, 0.0, -0.225])
STEP = 1e-6


def distances(horizon: Linearisation) -> Array:
    """Of every node from 1, wall and point."""
    return np.array(
        [
            np.array(wall.normal) @ horizon.position[node, point] - wall.offset - wall.clearance
            for node in range(1, NODES + 1)
            for wall in WALLS
            for point in range(3)
        ]
    )


def difference(case: Case, column: int, value: object) -> Array:
    change = np.zeros(INPUTS * NODES)
    change[column] = STEP
    assert callable(value)
    above, below = value(case.horizon(change)), value(case.horizon(-change))
    return np.asarray((above - below) / (2.0 * STEP))


def test_wall_rows_are_distances_and_ask_for_the_tightening() -> None:
    case = random_case(np.random.default_rng(1))
    hard = HardWalls(WALLS, NODES, tightening=0.05, first_node=1)
    hard.refill(case.horizon(), case.targets)
    np.testing.assert_allclose(hard.rows.value, distances(case.horizon()), atol=1e-12)
    assert (hard.rows.lower_bound == 0.05).all()
    for column in range(INPUTS * NODES):
        np.testing.assert_allclose(
            hard.rows.gradient[:, column], difference(case, column, distances), atol=1e-6
        )


@pytest.mark.parametrize("rho", [0.0, 0.05, 0.3])
def test_sphere_rows_are_the_distance_to_the_surface(rho: float) -> None:
    random = np.random.default_rng(2)
    case = random_case(random)
    for node in range(NODES + 1):
        away = random.standard_normal(3)
        away *= rho / np.linalg.norm(away)
        case.targets.position[node] = case.horizon().position[node, BASE] - away - OFFSET

    def gaps(horizon: Linearisation) -> Array:
        e = horizon.position[1:, BASE] - case.targets.position[1:] - OFFSET
        return np.asarray(0.075 - np.linalg.norm(e, axis=1))

    hard = HardWorkspace(
        WorkspaceSphere((0.0, 0.0, -0.225), 0.075), NODES, tightening=0.0, first_node=1
    )
    hard.refill(case.horizon(), case.targets)
    np.testing.assert_allclose(hard.rows.value, gaps(case.horizon()), atol=1e-12)
    assert np.isfinite(hard.rows.gradient).all()
    if rho > 0.0:  # at the centre the distance has no derivative
        for column in range(INPUTS * NODES):
            np.testing.assert_allclose(
                hard.rows.gradient[:, column], difference(case, column, gaps), atol=1e-5
            )


OBSTACLES = (
    PointObstacle((0.3, -0.8, -1.0), 0.2),
    PointObstacle((-1.5, 0.4, 0.5), 0.1),
    PointObstacle((0.5, 2.0, -0.7), 0.3, upright=True),
)


def clear_of(horizon: Linearisation, first_node: int) -> Array:
    """What is left to the surface of each ball, or cylinder, by node, obstacle and point."""
    position, _ = measured(horizon)
    left = []
    for node in range(first_node, NODES + 1):
        for one in OBSTACLES:
            for point in range(3):
                away = position[node, point] - one.position
                length = np.hypot(away[0], away[1]) if one.upright else np.linalg.norm(away)
                left.append(length - one.clearance)
    return np.array(left)


@pytest.mark.parametrize("first_node", [1, 2])
def test_obstacle_rows_are_distances_to_balls_and_cylinders(first_node: int) -> None:
    case = random_case(np.random.default_rng(3))
    hard = HardObstacles(OBSTACLES, NODES, tightening=0.04, first_node=first_node)
    hard.refill(case.horizon(), case.targets)
    rows, every = hard.rows, clear_of(case.horizon(), 0)
    np.testing.assert_allclose(hard.rows.start, every[:9], atol=1e-9)
    np.testing.assert_allclose(rows.value, every[9 * first_node :], atol=1e-9)
    assert (rows.lower_bound == 0.04).all()
    change = np.zeros(INPUTS * NODES)
    for column in range(0, INPUTS * NODES, 2):
        change[:] = 0.0
        change[column] = 1e-5
        above = clear_of(case.horizon(change), first_node)
        below = clear_of(case.horizon(-change), first_node)
        np.testing.assert_allclose(rows.gradient[:, column], (above - below) / 2e-5, atol=1e-5)


def test_in_the_obstacle_itself_its_rows_are_numbers() -> None:
    case = random_case(np.random.default_rng(4))
    centre = case.horizon().position[1, BASE]
    inside = (PointObstacle((float(centre[0]), float(centre[1]), float(centre[2])), 0.2),)
    hard = HardObstacles(inside, NODES, tightening=0.0, first_node=1)
    hard.refill(case.horizon(), case.targets)
    assert hard.rows.value[0] == pytest.approx(-0.2)
    assert np.isfinite(hard.rows.gradient).all()


Hard = HardWalls | HardObstacles | HardWorkspace
BLOCKS: list[tuple[Callable[[int], Hard], int, int]] = [
    (lambda first: HardWalls(WALLS, NODES, 0.0, first), 2, 3),
    (lambda first: HardObstacles(OBSTACLES, NODES, 0.0, first), 3, 3),
    (lambda first: HardWorkspace(WorkspaceSphere((0.0, 0.0, -0.2), 0.1), NODES, 0.0, first), 1, 1),
]


@pytest.mark.parametrize("first_node", [1, 3])
@pytest.mark.parametrize(("build", "surfaces", "points"), BLOCKS)
def test_each_surface_has_a_slack_of_its_own_at_each_node(
    build: Callable[[int], Hard], surfaces: int, points: int, first_node: int
) -> None:
    """The points of one surface and node share it, numbered without a gap from zero."""
    hard = build(first_node)
    nodes = [node for node in range(first_node, NODES + 1) for _ in range(surfaces * points)]
    slacks = [number for number in range(len(nodes) // points) for _ in range(points)]
    assert hard.rows.node.tolist() == nodes
    assert hard.rows.slack.tolist() == slacks
    assert hard.rows.slacks == slacks[-1] + 1
    assert hard.rows.start.shape == (surfaces * points,)


def test_the_start_is_told_of_node_zero() -> None:
    case = random_case(np.random.default_rng(5))
    position, _ = measured(case.horizon())
    walls = HardWalls(WALLS, NODES, tightening=0.0, first_node=2)
    walls.refill(case.horizon(), case.targets)
    left = [
        position[0, point] @ wall.normal - wall.offset - wall.clearance
        for wall in WALLS
        for point in range(3)
    ]
    np.testing.assert_allclose(walls.rows.start, left, atol=1e-9)
    np.testing.assert_allclose(walls.rows.value, distances(case.horizon())[6:], atol=1e-9)
    sphere = HardWorkspace(WorkspaceSphere((0.0, 0.0, -0.225), 0.3), NODES, 0.0, first_node=2)
    sphere.refill(case.horizon(), case.targets)
    away = position[0, BASE] - case.targets.position[0] - OFFSET
    assert sphere.rows.start == pytest.approx([0.3 - np.linalg.norm(away)])
