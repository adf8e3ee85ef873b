"""Each row of the workspace barrier against h of eq 23 along the prediction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.shapes.ball import outward_axis
from fsw.autopilot.shapes.target_sphere import target_sphere
from tests.fsw.autopilot.barriers.horizons import (
    NODES,
    Case,
    barrier_of,
    lowest_allowed,
    random_case,
    safe_speed,
)
from tests.fsw.paper_arm import INPUTS
from tests.fsw.random_states import vec3

RADIUS = 0.1
DIRECTIONS = 6
OFFSET = np.array([0.02, -0.03, -0.225])
SPHERE = target_sphere((0.02, -0.03, -0.225), RADIUS)
STEP = 1e-6


def case_at(random: np.random.Generator, rho: float) -> Case:
    """A random case with the centre at distance rho from the base, at every node."""
    case = random_case(random)
    position = case.horizon().states[:, 0:3]
    for node in range(NODES + 1):
        away = random.standard_normal(3)
        away *= rho / np.linalg.norm(away)
        case.targets.position[node] = position[node] - away - OFFSET
    return case


def relative(case: Case, horizon: Linearisation, node: int) -> tuple[Array, Array]:
    """Base from the sphere's centre, and its velocity."""
    centre = case.targets.position[node] + OFFSET
    return (
        horizon.states[node, 0:3] - centre,
        horizon.states[node, 3:6] - case.targets.velocity[node],
    )


def directions(e: Array) -> Array:
    """All round the centre, (6, 3)."""
    x, y, z = vec3(e)
    return np.array([outward_axis(x, y, z, which) for which in range(DIRECTIONS)])


def frozen_normals(case: Case) -> Array:
    """The six directions at each node of the guess (n + 1, 6, 3)."""
    normals = np.zeros((NODES + 1, DIRECTIONS, 3))
    horizon = case.horizon()
    for node in range(NODES + 1):
        normals[node] = directions(relative(case, horizon, node)[0])
    return normals


def h_along(n: Array, e: Array, w: Array) -> float:
    return safe_speed(RADIUS - float(n @ e)) - float(n @ w)


def h_by_hand(case: Case, change: Array | float, normals: Array) -> Array:
    horizon = case.horizon(change)
    return np.array(
        [
            h_along(n, *relative(case, horizon, node))
            for node in range(2, NODES + 1)
            for n in normals[node]
        ]
    )


@pytest.mark.parametrize("rho", [0.0, 0.001, 0.05, RADIUS, 0.5])
def test_rows_equal_h_and_its_finite_difference_along_the_prediction(rho: float) -> None:
    random = np.random.default_rng(1)
    for _ in range(2):
        case = case_at(random, rho)
        barrier = barrier_of((SPHERE,))
        barrier.refill(case.horizon(), case.targets)
        normals, rows = frozen_normals(case), barrier.rows
        np.testing.assert_allclose(rows.value, h_by_hand(case, 0.0, normals), atol=1e-12)
        e, w = relative(case, case.horizon(), 0)
        required = [
            lowest_allowed(h_along(n, e, w), node)
            for node in range(2, NODES + 1)
            for n in normals[node]
        ]
        np.testing.assert_allclose(rows.lower_bound, required, atol=1e-12)
        for column in range(INPUTS * NODES):
            change = np.zeros(INPUTS * NODES)
            change[column] = STEP
            above = h_by_hand(case, change, normals)
            below = h_by_hand(case, -change, normals)
            np.testing.assert_allclose(
                rows.gradient[:, column], (above - below) / (2 * STEP), atol=1e-5
            )


@pytest.mark.parametrize("rho", [0.05, RADIUS, 0.5], ids=["inside", "boundary", "outside"])
def test_first_pair_of_rows_is_the_papers_pair(rho: float) -> None:
    case = case_at(np.random.default_rng(2), rho)
    barrier = barrier_of((SPHERE,))
    barrier.refill(case.horizon(), case.targets)
    for node in range(2, NODES + 1):
        e, w = relative(case, case.horizon(), node)
        toward_centre = -e / np.linalg.norm(e)  # the paper's p, base to centre
        h2a = safe_speed(RADIUS - rho) + toward_centre @ w
        h2b = safe_speed(RADIUS + rho) - toward_centre @ w
        first = (node - 2) * DIRECTIONS
        np.testing.assert_allclose(barrier.rows.value[first : first + 2], [h2a, h2b], atol=1e-9)


def test_reported_h_is_the_smaller_of_the_papers_pair_at_the_start() -> None:
    for seed in range(10):
        case = case_at(np.random.default_rng(seed), 0.05)
        barrier = barrier_of((SPHERE,))
        barrier.refill(case.horizon(), case.targets)
        e, w = relative(case, case.horizon(), 0)
        n = e / np.linalg.norm(e)
        expected = min(h_along(n, e, w), h_along(-n, e, w))
        assert barrier.rows.start[0] == pytest.approx(expected)


def test_one_slack_a_node() -> None:
    rows = barrier_of((SPHERE,)).rows
    np.testing.assert_array_equal(rows.slack, rows.node - 2)
    assert rows.slacks == NODES - 1


@given(st.tuples(*[st.floats(-5.0, 5.0)] * 3))
def test_frame_is_orthonormal_and_starts_outward(components: tuple[float, float, float]) -> None:
    e = np.array(components)
    frame = directions(e)
    np.testing.assert_allclose(frame[0::2] @ frame[0::2].T, np.eye(3), atol=1e-12)
    np.testing.assert_array_equal(frame[1::2], -frame[0::2])
    if np.linalg.norm(e) > 0.0021:
        np.testing.assert_allclose(frame[0], e / np.linalg.norm(e), atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_frame_is_orthonormal_along_the_axes(axis: int, sign: float) -> None:
    e = np.zeros(3)
    e[axis] = sign
    frame = directions(e)[0::2]
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
