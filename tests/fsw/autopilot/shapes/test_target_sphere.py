"""The sphere of Case II keeps the base in; one without a radius holds nothing."""

from __future__ import annotations

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.target_sphere import target_sphere


def test_it_is_to_be_kept_in_and_rides_on_the_target() -> None:
    sphere = target_sphere((0.0, 0.0, -0.225), 0.075)
    assert sphere.keep_in
    assert sphere.clearance == 0.0
    assert sphere.shape.numbers == (0.0, 0.0, -0.225, 0.075)
    assert kind_of(sphere.shape).follows_target


def test_one_without_a_radius_is_refused() -> None:
    none = target_sphere((0.0, 0.0, -0.225), 0.0).shape
    assert kind_of(none).check(none) == "a sphere of radius 0 m contains nothing"
