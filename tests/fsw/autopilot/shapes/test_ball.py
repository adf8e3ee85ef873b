"""A ball of radius zero is a point, and in its very centre there are numbers."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.ball import ball, point
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import SafeSet, Vec3
from tests.fsw.autopilot.shapes.planes import inside, outside


def test_a_point_is_kept_its_clearance_from() -> None:
    (at,) = surfaces(SafeSet((point((1.0, 2.0, -3.0), 0.25),)), (1.0, 2.0, -4.0), 0)
    assert (at.distance, at.normal) == (0.75, (0.0, 0.0, -1.0))


@pytest.mark.parametrize("p", [(0.0, 0.0, 0.0), (0.001, -0.001, 0.0)])
def test_in_the_centre_any_direction_does(p: Vec3) -> None:
    at = outside(ball((0.0, 0.0, 0.0), 0.5), p)
    assert at.normal == (1.0, 0.0, 0.0)
    assert at.distance == pytest.approx(-0.5, abs=0.0015)
    for one in inside(ball((0.0, 0.0, 0.0), 0.5), p):
        assert one.distance == pytest.approx(0.5, abs=0.0015)
        assert np.isfinite(one).all()


def test_a_radius_below_zero_is_refused() -> None:
    small = ball((0.0, 0.0, 0.0), -0.1)
    assert kind_of(small).check(small) == "the radius is -0.1 m; it must not be < 0"
    none = ball((0.0, 0.0, 0.0), 0.0)
    assert kind_of(none).check(none) is None
