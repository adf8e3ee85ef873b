"""Where zones are at a time: by themselves, or with the target."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.shapes.ball import ball, point
from fsw.autopilot.shapes.box import box
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.zones import (
    acceleration_of,
    all_moving_zones,
    moved_by,
    moving_zones,
    nearest_plane,
    shifts,
    surfaces,
    velocity_of,
)
from fsw.autopilot.signals import EndEffectorTarget, SafeSet, Vec3, Zone

MOVING = Zone(ball((0.0, 0.0, 0.0), 0.5), 0.1, velocity=(1.0, -2.0, 0.5), t_us=2_000_000)
SPHERE = target_sphere((0.0, 0.0, -0.2), 0.3)


@pytest.mark.parametrize("t_us", [0, 2_000_000, 3_500_000])
def test_a_zone_in_motion_is_where_it_has_got_to(t_us: int) -> None:
    p: Vec3 = (3.0, 1.0, -1.0)
    centre = 1e-6 * (t_us - 2_000_000) * np.array(MOVING.velocity)
    away = np.array(p) - centre
    (at,) = surfaces(SafeSet((MOVING,)), p, t_us)
    assert at.distance == pytest.approx(np.linalg.norm(away) - 0.6)
    assert at.normal == pytest.approx(away / np.linalg.norm(away))


def test_the_sphere_is_with_the_target_and_without_one_there_is_none() -> None:
    both = SafeSet((point((1.0, 0.0, 0.0), 0.1), SPHERE))
    target = EndEffectorTarget(0, (0.0, 0.0, -1.0), (0.0,) * 3, (0.0,) * 3)
    branch, sphere = surfaces(both, (0.0, 0.1, -1.2), 0, target)
    assert sphere.distance == pytest.approx(0.2)
    assert sphere.normal == pytest.approx((0.0, -1.0, 0.0))
    assert surfaces(both, (0.0, 0.1, -1.2), 0) == (branch,)
    assert surfaces(SafeSet(), (0.0, 0.0, 0.0), 0) == ()


def test_shifts_of_each_zone_at_each_time() -> None:
    still = wall((1.0, 0.0, 0.0), 0.0, 0.1)
    times = np.array([2_000_000, 2_100_000])
    p_target, v_target = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), np.ones((2, 3))
    zones = all_moving_zones(SafeSet((still, MOVING, SPHERE)))
    moved, velocities = shifts(zones, times, p_target, v_target)
    np.testing.assert_allclose(moved[:, 0], 0.0)
    np.testing.assert_allclose(moved[:, 1], [[0.0, 0.0, 0.0], [0.1, -0.2, 0.05]], atol=1e-15)
    np.testing.assert_array_equal(moved[:, 2], p_target)
    np.testing.assert_array_equal(velocities[0], [[0.0] * 3, [1.0, -2.0, 0.5], [1.0] * 3])


def test_the_nearest_plane_for_kernels_is_that_of_the_surface() -> None:
    room = Zone(box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)), 0.1, keep_in=True)
    zones = SafeSet((MOVING, SPHERE, room))
    rows = moving_zones(zones, None)
    p: Vec3 = (0.3, -0.4, 0.2)
    found = tuple(nearest_plane(rows, k, p, 2_500_000) for k in range(len(rows)))
    assert found == surfaces(zones, p, 2_500_000)
    assert moved_by(rows, 0, 2_500_000) == (0.5, -1.0, 0.25)
    assert velocity_of(rows, 0, 2_500_000) == MOVING.velocity


def test_a_sphere_that_follows_turns_with_its_target() -> None:
    target = EndEffectorTarget(1_000_000, (1.0, 2.0, 3.0), (0.5, 0.0, -1.0), (2.0, -3.0, 0.0))
    rows = moving_zones(SafeSet((SPHERE,)), target)
    np.testing.assert_allclose(moved_by(rows, 0, 1_200_000), (1.14, 1.94, 2.8))
    np.testing.assert_allclose(velocity_of(rows, 0, 1_200_000), (0.9, -0.6, -1.0))
    assert acceleration_of(rows, 0) == target.a_WE
