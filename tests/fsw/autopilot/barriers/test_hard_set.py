"""MPC-HC's rows are distances: against h = d written out, with gradients by finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.vertical_cylinder import column
from fsw.autopilot.signals import Zone
from tests.fsw.autopilot.barriers.horizons import (
    NODES,
    Case,
    distances_of,
    front_of,
    measured,
    random_case,
)
from tests.fsw.autopilot.model.three_points import positions_of
from tests.fsw.paper_arm import INPUTS
from tests.fsw.random_states import vec3

WALLS = (wall((-1.0, 0.0, 0.0), -1.0, 0.1), wall((0.0, 0.6, 0.8), -1.5, 0.05))
OFFSET = np.array([0.0, 0.0, -0.225])
STEP = 1e-6


def distances(horizon: Linearisation) -> Array:
    """Of every node from 1, wall and point."""
    position = positions_of(horizon)[0]
    fronts = [front_of(one) for one in WALLS]
    return np.array(
        [
            normal @ position[node, k] - offset
            for node in range(1, NODES + 1)
            for normal, offset in fronts
            for k in range(3)
        ]
    )


def difference(case: Case, entry: int, value: object) -> Array:
    change = np.zeros(INPUTS * NODES)
    change[entry] = STEP
    assert callable(value)
    above, below = value(case.horizon(change)), value(case.horizon(-change))
    return np.asarray((above - below) / (2.0 * STEP))


def test_wall_rows_are_distances_and_ask_for_the_tightening() -> None:
    case = random_case(np.random.default_rng(1))
    hard = distances_of(WALLS, tightening=0.05)
    hard.refill(case.horizon(), case.targets)
    np.testing.assert_allclose(hard.rows.value, distances(case.horizon()), atol=1e-12)
    assert (hard.rows.lower_bound == 0.05).all()
    for entry in range(INPUTS * NODES):
        np.testing.assert_allclose(
            hard.rows.gradient[:, entry], difference(case, entry, distances), atol=1e-6
        )


@pytest.mark.parametrize("rho", [0.0, 0.05, 0.3])
def test_sphere_rows_are_distances_along_six_directions_the_nearest_first(rho: float) -> None:
    random = np.random.default_rng(2)
    case = random_case(random)
    for node in range(NODES + 1):
        away = random.standard_normal(3)
        away *= rho / np.linalg.norm(away)
        case.targets.position[node] = case.horizon().states[node, 0:3] - away - OFFSET

    def gaps(horizon: Linearisation) -> Array:
        e = horizon.states[1:, 0:3] - case.targets.position[1:] - OFFSET
        return np.asarray(0.075 - np.linalg.norm(e, axis=1))

    hard = distances_of((target_sphere((0.0, 0.0, -0.225), 0.075),))
    hard.refill(case.horizon(), case.targets)
    values = hard.rows.value.reshape(NODES, 6)
    nearest = gaps(case.horizon())
    np.testing.assert_allclose(values[:, 0], nearest, atol=1e-12)
    np.testing.assert_allclose(values[:, 1], 0.15 - nearest, atol=1e-12)  # the opposite place
    np.testing.assert_allclose(values[:, 2:], 0.075, atol=1e-12)  # sideways there is no offset
    assert np.isfinite(hard.rows.gradient).all()
    gradients = hard.rows.gradient.reshape(NODES, 6, -1)
    np.testing.assert_array_equal(gradients[:, 1::2], -gradients[:, 0::2])
    if rho > 0.0:  # at the centre the distance has no derivative
        for entry in range(INPUTS * NODES):
            np.testing.assert_allclose(
                gradients[:, 0, entry], difference(case, entry, gaps), atol=1e-5
            )


OBSTACLES = (
    point((0.3, -0.8, -1.0), 0.2),
    point((-1.5, 0.4, 0.5), 0.1),
    column((0.5, 2.0), 0.3),
)


def clear_of(horizon: Linearisation, first_node: int) -> Array:
    """What is left to the surface of each ball, or cylinder, by node, obstacle and point."""
    position, _ = measured(horizon)
    left = []
    for node in range(first_node, NODES + 1):
        for one in OBSTACLES:
            axes = 2 if one.shape.kind == "vertical cylinder" else 3
            for k in range(3):
                away = position[node, k, :axes] - one.shape.numbers[:axes]
                left.append(np.linalg.norm(away) - one.clearance)
    return np.array(left)


@pytest.mark.parametrize("skipped", [0, 1])
def test_obstacle_rows_are_distances_to_balls_and_cylinders(skipped: int) -> None:
    case = random_case(np.random.default_rng(3))
    first_node = 1 + skipped
    hard = distances_of(OBSTACLES, tightening=0.04, skipped_nodes=skipped)
    hard.refill(case.horizon(), case.targets)
    rows, every = hard.rows, clear_of(case.horizon(), 0)
    np.testing.assert_allclose(hard.rows.start, every[:9], atol=1e-9)
    np.testing.assert_allclose(rows.value, every[9 * first_node :], atol=1e-9)
    assert (rows.lower_bound == 0.04).all()
    change = np.zeros(INPUTS * NODES)
    for entry in range(0, INPUTS * NODES, 2):
        change[:] = 0.0
        change[entry] = 1e-5
        above = clear_of(case.horizon(change), first_node)
        below = clear_of(case.horizon(-change), first_node)
        np.testing.assert_allclose(rows.gradient[:, entry], (above - below) / 2e-5, atol=1e-5)


def test_in_the_obstacle_itself_its_rows_are_numbers() -> None:
    case = random_case(np.random.default_rng(4))
    hard = distances_of((point(vec3(case.horizon().states[1, 0:3]), 0.2),))
    hard.refill(case.horizon(), case.targets)
    assert hard.rows.value[0] == pytest.approx(-0.2)
    assert np.isfinite(hard.rows.gradient).all()


SPHERE = target_sphere((0.0, 0.0, -0.2), 0.1)


@pytest.mark.parametrize("first_node", [1, 3])
@pytest.mark.parametrize(
    ("zones", "rows_of_each", "starts"),
    [
        (WALLS, (3, 3), 6),
        (OBSTACLES, (3, 3, 3), 9),
        ((SPHERE,), (6,), 1),
        ((*WALLS, SPHERE), (3, 3, 6), 7),
    ],
)
def test_each_zone_has_a_slack_of_its_own_at_each_node(
    zones: tuple[Zone, ...], rows_of_each: tuple[int, ...], starts: int, first_node: int
) -> None:
    """The rows of one zone and node share it, numbered without a gap from zero."""
    hard = distances_of(zones, skipped_nodes=first_node - 1)
    nodes = [node for node in range(first_node, NODES + 1) for _ in range(sum(rows_of_each))]
    each = rows_of_each * (NODES + 1 - first_node)
    slacks = [number for number, rows in enumerate(each) for _ in range(rows)]
    assert hard.rows.node.tolist() == nodes
    assert hard.rows.slack.tolist() == slacks
    assert hard.rows.slacks == slacks[-1] + 1
    assert hard.rows.start.shape == (starts,)


def test_the_start_is_told_of_node_zero() -> None:
    case = random_case(np.random.default_rng(5))
    position, _ = measured(case.horizon())
    walls = distances_of(WALLS, skipped_nodes=1)
    walls.refill(case.horizon(), case.targets)
    fronts = [front_of(one) for one in WALLS]
    left = [position[0, k] @ normal - offset for normal, offset in fronts for k in range(3)]
    np.testing.assert_allclose(walls.rows.start, left, atol=1e-9)
    np.testing.assert_allclose(walls.rows.value, distances(case.horizon())[6:], atol=1e-9)
    sphere = distances_of((target_sphere((0.0, 0.0, -0.225), 0.3),), skipped_nodes=1)
    sphere.refill(case.horizon(), case.targets)
    away = position[0, 0] - case.targets.position[0] - OFFSET
    assert sphere.rows.start == pytest.approx([0.3 - np.linalg.norm(away)])
