"""A wall has one plane, wherever the point is."""

from __future__ import annotations

import pytest

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.half_space import half_space, wall
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import SafeSet
from tests.fsw.autopilot.shapes.planes import inside


def test_a_wall_is_kept_its_clearance_from() -> None:
    (at,) = surfaces(SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1),)), (0.5, 9.0, -4.0), 0)
    assert (at.distance, at.normal) == (pytest.approx(0.4), (-1.0, 0.0, 0.0))


def test_to_keep_in_is_to_stay_behind_it() -> None:
    (at,) = inside(half_space((0.0, 0.0, 1.0), 2.0), (0.0, 0.0, 1.5))
    assert (at.distance, at.normal) == (0.5, (0.0, 0.0, -1.0))


def test_a_normal_that_is_not_of_length_one_is_refused() -> None:
    long = half_space((0.0, 0.0, 1.01), 2.0)
    assert kind_of(long).check(long) == "the normal of a half-space has length 1.01; 1 is needed"
