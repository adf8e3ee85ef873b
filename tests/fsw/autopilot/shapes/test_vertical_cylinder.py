"""A column has no end; a person has a head."""

from __future__ import annotations

import pytest

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.cylinder import cylinder
from fsw.autopilot.shapes.vertical_cylinder import column, vertical_cylinder
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import SafeSet, Shape
from tests.fsw.autopilot.shapes.planes import outside


@pytest.mark.parametrize("height", [-900.0, -1.0, 0.0, 50.0])
def test_a_column_is_kept_off_at_any_height(height: float) -> None:
    (at,) = surfaces(SafeSet((column((1.0, 1.0), 0.3),)), (4.0, 5.0, height), 0)
    assert at.distance == pytest.approx(4.7)
    assert at.normal == pytest.approx((0.6, 0.8, 0.0))


def test_one_that_ends_is_the_cylinder_of_the_same_ends() -> None:
    person = vertical_cylinder((1.0, 2.0), 0.3, top=-1.8, bottom=0.0)
    same = cylinder((1.0, 2.0, -1.8), (1.0, 2.0, 0.0), 0.3)
    for p in ((1.1, 2.0, -2.5), (4.0, 5.0, -1.0), (2.0, 3.0, -3.0), (1.0, 2.1, -1.0)):
        assert outside(person, p) == pytest.approx(outside(same, p))


@pytest.mark.parametrize(
    ("shape", "problem"),
    [
        (
            vertical_cylinder((0.0, 0.0), 0.3, top=1.0, bottom=1.0),
            "a cylinder from 1 m down to 1 m has no height",
        ),
        (vertical_cylinder((0.0, 0.0), -0.3), "the radius is -0.3 m; it must not be < 0"),
    ],
)
def test_what_is_no_column_is_refused(shape: Shape, problem: str) -> None:
    assert kind_of(shape).check(shape) == problem
