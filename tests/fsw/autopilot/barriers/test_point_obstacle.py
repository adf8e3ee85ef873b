"""Rows of the point obstacle against h0 written out, with slopes by finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.barriers.zone_rows import ZoneRows
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.vertical_cylinder import column
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import SafeSet
from tests.fsw.autopilot.barriers.horizons import (
    NODES,
    Case,
    barrier_of,
    lowest_allowed,
    measured,
    random_case,
    safe_speed,
)
from tests.fsw.autopilot.model.three_points import positions_of
from tests.fsw.paper_arm import INPUTS
from tests.fsw.random_states import vec3

STEP = 1e-6
CLEARANCES = (0.1, 0.4)


def obstacles_near(random: np.random.Generator, case: Case, distance: float) -> Array:
    """Two places at about this distance from the base, (2, 3)."""
    away = random.standard_normal((2, 3))
    away *= distance / np.linalg.norm(away, axis=1)[:, None]
    return np.asarray(case.start[0:3] + away)


def refilled(places: Array, case: Case) -> ZoneRows:
    obstacles = tuple(
        point(vec3(place), clearance) for place, clearance in zip(places, CLEARANCES, strict=True)
    )
    barrier = barrier_of(obstacles)
    barrier.refill(case.horizon(), case.targets)
    return barrier


def rays_at(horizon: Linearisation, place: Array) -> Array:
    away = positions_of(horizon)[0] - place
    return np.asarray(away / np.linalg.norm(away, axis=2)[:, :, None])


def h_by_hand(places: Array, frozen: Linearisation, horizon: Linearisation) -> Array:
    """By node from 2, obstacle and point, with the directions of the frozen horizon."""
    h = []
    position, velocity = positions_of(horizon)
    rays = [rays_at(frozen, place) for place in places]
    for node in range(2, NODES + 1):
        for ray, place, clearance in zip(rays, places, CLEARANCES, strict=True):
            for k in range(3):
                n = ray[node, k]
                gap = n @ (position[node, k] - place) - clearance
                h.append(safe_speed(gap) + n @ velocity[node, k])
    return np.array(h)


@pytest.mark.parametrize("distance", [0.3, 1.0, 3.0])
def test_rows_are_h0_of_every_critical_point_and_their_slopes_its_differences(
    distance: float,
) -> None:
    random = np.random.default_rng(3)
    for _ in range(3):
        case = random_case(random)
        places = obstacles_near(random, case, distance)
        rows, frozen = refilled(places, case).rows, case.horizon()
        np.testing.assert_allclose(rows.value, h_by_hand(places, frozen, frozen), atol=1e-12)
        for entry in range(INPUTS * NODES):
            change = np.zeros(INPUTS * NODES)
            change[entry] = STEP
            above = h_by_hand(places, frozen, case.horizon(change))
            below = h_by_hand(places, frozen, case.horizon(-change))
            np.testing.assert_allclose(
                rows.gradient[:, entry], (above - below) / (2.0 * STEP), atol=1e-4
            )


def test_the_rows_ask_for_the_decay_of_h_from_where_the_vehicle_is() -> None:
    random = np.random.default_rng(4)
    case = random_case(random)
    places = obstacles_near(random, case, 1.0)
    barrier, horizon = refilled(places, case), case.horizon()
    position, velocity = positions_of(horizon)
    required, start = [], []
    for place, clearance in zip(places, CLEARANCES, strict=True):
        for k in range(3):
            p, v = position[0, k] - place, velocity[0, k]
            distance = float(np.linalg.norm(p))
            start.append(safe_speed(distance - clearance) + p @ v / distance)
    for node in range(2, NODES + 1):
        for place, clearance in zip(places, CLEARANCES, strict=True):
            for k in range(3):
                n = rays_at(horizon, place)[node, k]
                p, v = position[0, k] - place, velocity[0, k]
                required.append(lowest_allowed(safe_speed(n @ p - clearance) + n @ v, node))
    np.testing.assert_allclose(barrier.rows.start, start, atol=1e-12)
    np.testing.assert_allclose(barrier.rows.lower_bound, required, atol=1e-12)


def test_far_away_an_obstacle_is_the_wall_that_its_tangent_plane_is() -> None:
    """Seen from a thousand kilometres the direction is the same for every point and node."""
    case = random_case(np.random.default_rng(5))
    centre = np.array([1e6, 2e6, -3e6])
    n = (case.start[0:3] - centre) / np.linalg.norm(case.start[0:3] - centre)
    branch = barrier_of((point(vec3(centre), 0.2),))
    plane = barrier_of((wall(vec3(n), float(n @ centre), 0.2),))
    for barrier in (branch, plane):
        barrier.refill(case.horizon(), case.targets)
    np.testing.assert_allclose(branch.rows.gradient, plane.rows.gradient, atol=1e-4)
    np.testing.assert_array_equal(branch.rows.slack, plane.rows.slack)


def test_each_obstacle_has_its_slack_at_each_node() -> None:
    rows = refilled(np.ones((2, 3)), random_case(np.random.default_rng(6))).rows
    assert rows.slacks == 2 * (NODES - 1)
    np.testing.assert_array_equal(rows.slack[:6], [0, 0, 0, 1, 1, 1])
    for slack in range(rows.slacks):
        assert len(set(rows.node[rows.slack == slack])) == 1


def test_in_the_obstacle_itself_the_rows_are_numbers() -> None:
    case = random_case(np.random.default_rng(7))
    rows = refilled(np.tile(case.start[0:3], (2, 1)), case).rows
    assert np.isfinite(rows.value).all()
    assert np.isfinite(rows.gradient).all()
    here = SafeSet((point((1.0, 2.0, 3.0), 0.1),))
    assert surfaces(here, (1.0, 2.0, 3.0), 0) == ((-0.1, 1.0, 0.0, 0.0),)


def test_the_tangent_plane_has_the_ball_behind_it() -> None:
    random = np.random.default_rng(8)
    for _ in range(50):
        centre, p = random.uniform(-1.0, 1.0, (2, 3))
        (at,) = surfaces(SafeSet((point(vec3(centre), 0.3),)), vec3(p), 0)
        n = np.array(at.normal)
        assert at.distance == pytest.approx(np.linalg.norm(p - centre) - 0.3)
        assert n @ (centre + 0.3 * n) <= n @ p - at.distance + 1e-12


def test_the_plane_of_a_wall_is_the_wall_itself() -> None:
    walls = SafeSet((wall((-0.6, 0.0, 0.8), -1.0, 0.1),))
    (at,) = surfaces(walls, (0.5, 7.0, -0.25), 0)
    assert at.normal == (-0.6, 0.0, 0.8)
    assert at.distance == pytest.approx(0.4)


def test_an_upright_obstacle_is_kept_off_at_any_height() -> None:
    """Its rows are those of a ball at the height of each point."""
    case = random_case(np.random.default_rng(7))
    place = case.start[0:3] + [0.9, -0.6, 0.0]
    barrier = barrier_of((column((float(place[0]), float(place[1])), 0.2),))
    barrier.refill(case.horizon(), case.targets)
    position, velocity = measured(case.horizon())
    expected = []
    for node in range(2, NODES + 1):
        for k in range(3):
            away = (position[node, k] - place)[:2]
            distance = float(np.linalg.norm(away))
            approach = float(away @ velocity[node, k, :2]) / distance
            expected.append(safe_speed(distance - 0.2) + approach)
    np.testing.assert_allclose(barrier.rows.value, expected, atol=1e-5)
