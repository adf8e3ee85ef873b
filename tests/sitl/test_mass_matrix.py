"""The composite mass matrix is the recursion's own, column by column."""

from __future__ import annotations

import numpy as np
import pytest

from sitl.plant.bodies import empty_posture, posture_into
from sitl.plant.mass_matrix import mass_matrix_into, solve_in_place
from sitl.plant.newton_euler import wrench_needed_into
from sitl.plant.parameters import chain
from sitl.plant.vector import V3
from tests.sitl.vehicles import random_vehicle


@pytest.mark.drawn(3)
@pytest.mark.parametrize("joints", range(1, 7))
def test_each_column_is_the_wrench_that_one_unit_acceleration_needs(joints: int) -> None:
    random = np.random.default_rng(joints)
    bodies, at, size = chain(random_vehicle(joints, 4, random)), empty_posture(), 6 + joints
    posture_into(bodies, random.uniform(-3.0, 3.0, joints), 0, at)
    lower, column = np.empty((size, size)), np.empty(size)
    mass_matrix_into(bodies, at, lower)
    matrix = np.tril(lower) + np.tril(lower, -1).T

    def three(values: np.ndarray) -> V3:
        return (float(values[0]), float(values[1]), float(values[2]))

    for k, unit in enumerate(np.eye(size)):
        a, alpha, qdd = three(unit), three(unit[3:]), unit[6:].copy()
        still = (0.0, 0.0, 0.0)
        wrench_needed_into(bodies, at, still, alpha, a, np.zeros(joints), qdd, column)
        assert np.abs(column - matrix[:, k]).max() <= 1e-14 * np.abs(matrix).max()


def test_the_solver_solves() -> None:
    random = np.random.default_rng(0)
    root = random.standard_normal((8, 8))
    matrix, right = root @ root.T + np.eye(8), random.standard_normal(8)
    x = right.copy()
    solve_in_place(matrix.copy(), x, 8)
    assert np.abs(matrix @ x - right).max() <= 1e-13 * np.abs(right).max() * np.abs(matrix).max()
