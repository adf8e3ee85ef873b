"""Rims and axis of a cylinder, and what is no cylinder."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.cylinder import cylinder
from fsw.autopilot.signals import Shape, Vec3
from tests.fsw.autopilot.shapes.planes import inside, outside

PIPE = cylinder((-2.0, 0.0, 0.0), (2.0, 0.0, 0.0), 0.5)


def test_mantle_end_and_rim_are_each_nearest_from_somewhere() -> None:
    mantle, end, rim = (
        outside(PIPE, p) for p in ((1.0, 0.0, -2.0), (3.0, 0.2, 0.0), (2.3, 0.0, 0.9))
    )
    assert (mantle.distance, mantle.normal) == (pytest.approx(1.5), (0.0, 0.0, -1.0))
    assert (end.distance, end.normal) == (pytest.approx(1.0), (1.0, 0.0, 0.0))
    assert (rim.distance, rim.normal) == (pytest.approx(0.5), pytest.approx((0.6, 0.0, 0.8)))


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8)])
def test_on_the_axis_any_direction_across_it_does(axis: Vec3) -> None:
    x, y, z = axis
    pipe = cylinder((-x, -y, -z), axis, 0.25)
    at = outside(pipe, (0.1 * x, 0.1 * y, 0.1 * z))
    assert at.distance == pytest.approx(-0.25)
    assert np.dot(at.normal, axis) == pytest.approx(0.0, abs=1e-12)
    assert math.hypot(*at.normal) == pytest.approx(1.0)
    assert min(one.distance for one in inside(pipe, (0.0, 0.0, 0.0))) == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("shape", "problem"),
    [
        (
            cylinder((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.5),
            "a cylinder has length 0 m; at least 0.001 m is needed",
        ),
        (
            cylinder((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0),
            "a cylinder has radius 0 m; > 0 is needed",
        ),
    ],
)
def test_what_is_no_cylinder_is_refused(shape: Shape, problem: str) -> None:
    assert kind_of(shape).check(shape) == problem
