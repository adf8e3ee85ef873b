"""What telemetry says of the safe set agrees with what the planner is held to."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fsw.barriers.point_obstacle import PointObstacleBarrier
from fsw.barriers.wall import WallBarrier
from fsw.barriers.workspace import WorkspaceBarrier

from fsw.barriers.margins import PointMotion, constraint_report
from fsw.model.linearisation import Linearisation
from fsw.signals import (
    ConstraintKind,
    EndEffectorTarget,
    PointObstacle,
    SafeSet,
    Wall,
    WorkspaceSphere,
)
from tests.fsw.barriers.horizons import MODEL, TUNING, Case, random_case
from tests.fsw.random_states import vec3

STILL = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def points_at_start(horizon: Linearisation) -> tuple[PointMotion, PointMotion, PointMotion]:
    base, joint2, tip = (
        (vec3(horizon.position[0, k]), vec3(horizon.velocity[0, k])) for k in range(3)
    )
    return base, joint2, tip


def target_at_start(case: Case) -> EndEffectorTarget:
    p, v = case.targets.position[0], case.targets.velocity[0]
    return EndEffectorTarget(0, vec3(p), vec3(v), (0.0, 0.0, 0.0))


def test_wall_report_equals_the_rows_at_the_start() -> None:
    random = np.random.default_rng(1)
    walls = (Wall((-1.0, 0.0, 0.0), -1.0, 0.1), Wall((0.0, 0.6, 0.8), -2.0, 0.05))
    for _ in range(10):
        case = random_case(random)
        barrier = WallBarrier(walls, TUNING, MODEL)
        barrier.refill(case.horizon(), case.targets)
        report = constraint_report(SafeSet(walls), TUNING, points_at_start(case.horizon()), None)
        assert report.kind is ConstraintKind.WALLS
        np.testing.assert_allclose(report.barrier, barrier.rows.start, atol=1e-12)


def test_the_report_of_walls_and_points_equals_the_rows_at_the_start() -> None:
    random = np.random.default_rng(3)
    walls = (Wall((-1.0, 0.0, 0.0), -1.0, 0.1),)
    obstacles = (PointObstacle((0.4, -0.3, -1.0), 0.2), PointObstacle((2.0, 1.0, 0.0), 0.1))
    for _ in range(10):
        case = random_case(random)
        points = points_at_start(case.horizon())
        rows: list[float] = []
        for barrier in (
            WallBarrier(walls, TUNING, MODEL),
            PointObstacleBarrier(obstacles, TUNING, MODEL),
        ):
            barrier.refill(case.horizon(), case.targets)
            rows += barrier.rows.start.tolist()
        report = constraint_report(SafeSet(walls, obstacles=obstacles), TUNING, points, None)
        assert report.kind is ConstraintKind.OBSTACLES
        np.testing.assert_allclose(report.barrier, rows, atol=1e-12)
        distances = [math.dist(p, one.position) - one.clearance for one in obstacles
                     for p, _ in points]  # fmt: skip
        assert report.margins[3:] == pytest.approx(distances)


def test_wall_margin_is_the_distance_that_is_left_in_order_of_the_points() -> None:
    wall = Wall((-1.0, 0.0, 0.0), -1.0, 0.1)
    still = (0.0, 0.0, 0.0)
    points: tuple[PointMotion, PointMotion, PointMotion] = (
        ((0.0, 0.0, -1.0), still),
        ((0.5, 0.0, -1.0), still),
        ((0.95, 0.0, -1.0), still),
    )
    report = constraint_report(SafeSet((wall,)), TUNING, points, None)
    assert report.margins == pytest.approx((0.9, 0.4, -0.05))


def test_sphere_report_is_the_outward_row_at_the_start() -> None:
    random = np.random.default_rng(2)
    sphere = WorkspaceSphere((0.0, 0.0, -0.225), 0.5)
    for _ in range(20):
        case = random_case(random)
        case.targets.position[0] = case.start[0:3] + random.uniform(-0.2, 0.2, 3)
        horizon, target = case.horizon(), target_at_start(case)
        barrier = WorkspaceBarrier(sphere, TUNING, MODEL)
        barrier.refill(horizon, case.targets)
        report = constraint_report(SafeSet(sphere=sphere), TUNING, points_at_start(horizon), target)
        e = case.start[0:3] - case.targets.position[0] - np.array(sphere.centre_from_target)
        w = case.start[3:6] - case.targets.velocity[0]
        rho = np.linalg.norm(e)
        assert report.margins == pytest.approx((0.5 - rho,))
        outward_speed = e @ w / rho
        if outward_speed >= 0.0:  # then the outward row is the tighter of the paper's pair
            assert report.barrier[0] == pytest.approx(float(barrier.rows.start[0]))
        else:
            assert report.barrier[0] >= barrier.rows.start[0] - 1e-12


def test_sphere_report_at_the_centre_is_a_number() -> None:
    sphere = WorkspaceSphere((0.0, 0.0, -0.225), 0.075)
    target = EndEffectorTarget(0, (0.0, 0.0, 0.225), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    moving = ((0.0, 0.0, 0.0), (1.0, -2.0, 0.5))
    report = constraint_report(SafeSet(sphere=sphere), TUNING, (moving, STILL, STILL), target)
    assert report.margins == (0.075,)
    assert np.isfinite(report.barrier).all()


def test_open_space_and_a_sphere_without_target_report_nothing() -> None:
    points = (STILL, STILL, STILL)
    assert constraint_report(SafeSet(), TUNING, points, None).margins == ()
    sphere = SafeSet(sphere=WorkspaceSphere((0.0, 0.0, -0.2), 0.1))
    assert constraint_report(sphere, TUNING, points, None).margins == ()
