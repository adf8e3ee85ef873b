"""PX4's messages as a frame of readings, with SciPy's rotations as oracle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.link.px4.estimate import OLDEST_US, Px4Estimate

BODY, WORLD = 12, 1


def odometry(t_us: int, p: tuple, q: tuple, v: tuple, child: int, frame: int = 1) -> tuple:  # type: ignore[type-arg]
    return (t_us, *p, *q, *v, *(0.0,) * 3, *(0.0,) * 42, frame, child, 0, 8, 0)


def attitude(t_us: int, q: tuple, w: tuple = (0.0, 0.0, 0.0)) -> tuple:  # type: ignore[type-arg]
    return (t_us // 1000, *q, *w, *(0.0,) * 4)


def turned(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> tuple[float, ...]:
    x, y, z, w = Rotation.from_euler("ZYX", (yaw, pitch, roll)).as_quat()
    return w, x, y, z


@pytest.mark.parametrize("yaw", [0.0, 0.5 * math.pi, math.pi, -2.0])
@pytest.mark.parametrize("child", [BODY, WORLD])
def test_a_velocity_is_the_worlds_in_either_convention(yaw: float, child: int) -> None:
    q, world = turned(yaw, 0.1, -0.2), np.array([0.7, -0.3, 0.1])
    body = Rotation.from_euler("ZYX", (yaw, 0.1, -0.2)).inv().apply(world)
    said = body if child == BODY else world
    estimate = Px4Estimate()
    assert estimate.take_odometry(odometry(1_000_000, (1.0, 2.0, -3.0), q, tuple(said), child))
    assert estimate.take_attitude(attitude(1_000_000, q))
    frame = estimate.frame(0, (), ())
    assert frame.v_WB == pytest.approx(world, abs=1e-6)
    assert frame.p_WB == pytest.approx((1.0, 2.0, -3.0))
    assert frame.t_us == 1_000_000


@pytest.mark.parametrize(("frame", "child"), [(1, 0), (1, 20), (20, 1), (0, 12)])
def test_frames_that_mean_nothing_here_are_refused(frame: int, child: int) -> None:
    level = turned(0.0)
    assert not Px4Estimate().take_odometry(odometry(1, (0.0,) * 3, level, (0.0,) * 3, child, frame))


def test_a_position_is_moved_on_to_the_attitudes_instant() -> None:
    """By velocity and by what the lean says: 0.1 rad nose up accelerates backwards."""
    estimate, q = Px4Estimate(), turned(0.0, 0.1)
    estimate.take_odometry(odometry(1_000_000, (0.0,) * 3, q, (2.0, 0.0, 0.0), WORLD))
    estimate.take_attitude(attitude(1_008_000, q))
    frame = estimate.frame(500, (), ())
    a = -9.81 * math.tan(0.1)
    assert frame.p_WB[0] == pytest.approx(2.0 * 0.008 + 0.5 * a * 0.008**2, rel=1e-6)
    assert frame.v_WB[0] == pytest.approx(2.0 + a * 0.008, rel=1e-6)
    assert frame.t_us == 1_008_500
    estimate.take_attitude(attitude(1_000_000 + OLDEST_US + 1_000, q))
    assert math.isnan(estimate.frame(0, (), ()).p_WB[0]), "too old to be moved on"


def test_an_attitude_that_is_no_newer_makes_no_tick() -> None:
    estimate, q = Px4Estimate(), turned(0.0)
    assert estimate.take_attitude(attitude(8_000, q))
    assert not estimate.take_attitude(attitude(8_000, q))
    assert not estimate.take_attitude(attitude(4_000, q))
