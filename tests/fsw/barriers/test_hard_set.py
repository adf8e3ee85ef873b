"""MPC-HC's rows are distances: against h = d written out, with gradients by finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.barriers.hard_set import HardWalls, HardWorkspace
from fsw.model.linearisation import BASE, Linearisation
from fsw.model.prediction import INPUTS, Array
from fsw.signals import Wall, WorkspaceSphere
from tests.fsw.barriers.horizons import NODES, Case, random_case

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
