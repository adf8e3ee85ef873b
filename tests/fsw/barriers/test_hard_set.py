"""MPC-HC's rows are distances: against h = d written out, with gradients by finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.barriers.hard_set import HardWalls, HardWorkspace
from fsw.barriers.point_obstacle import PointObstacleBarrier
from fsw.model.linearisation import BASE, Linearisation
from fsw.model.prediction import INPUTS, Array
from fsw.signals import Wall, WorkspaceSphere
from tests.fsw.barriers.horizons import (
    NODES,
    TUNING,
    Case,
    lowest_allowed,
    random_case,
    safe_speed,
)

WALLS = (Wall((-1.0, 0.0, 0.0), -1.0, 0.1), Wall((0.0, 0.6, 0.8), -1.5, 0.05))
OFFSET = np.array([0.0, 0.0, -0.225])
OBSTACLE = np.array([3.0, -3.0, 1.0])  # away from every random base
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
    assert (hard.rows.required == 0.05).all()
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


def test_obstacle_rows_are_h_of_eq_11_along_the_frozen_ray() -> None:
    case = random_case(np.random.default_rng(3))
    barrier = PointObstacleBarrier((3.0, -3.0, 1.0), 0.4, TUNING, NODES)
    barrier.refill(case.horizon(), case.targets)
    frozen = case.horizon().position[:, BASE] - OBSTACLE
    rays = frozen / np.linalg.norm(frozen, axis=1)[:, None]

    def h(horizon: Linearisation) -> Array:
        p, v = horizon.position[:, BASE] - OBSTACLE, horizon.velocity[:, BASE]
        return np.array(
            [safe_speed(rays[k] @ p[k] - 0.4) + rays[k] @ v[k] for k in range(2, NODES + 1)]
        )

    np.testing.assert_allclose(barrier.rows.value, h(case.horizon()), atol=1e-12)
    start_p, start_v = frozen[0], case.horizon().velocity[0, BASE]
    required = [
        lowest_allowed(safe_speed(rays[k] @ start_p - 0.4) + rays[k] @ start_v, k)
        for k in range(2, NODES + 1)
    ]
    np.testing.assert_allclose(barrier.rows.required, required, atol=1e-12)
    for column in range(INPUTS * NODES):
        np.testing.assert_allclose(
            barrier.rows.gradient[:, column], difference(case, column, h), atol=1e-5
        )
