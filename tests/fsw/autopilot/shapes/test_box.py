"""The edges and corners of a box, its attitude, and what is no box."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.box import box
from fsw.autopilot.signals import Shape
from tests.fsw.autopilot.shapes.planes import inside, outside

CRATE = box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))


def test_an_edge_and_a_corner_are_nearest_along_the_way_to_them() -> None:
    edge = outside(CRATE, (4.0, 6.0, 0.0))
    assert (edge.distance, edge.normal) == (pytest.approx(5.0), pytest.approx((0.6, 0.8, 0.0)))
    corner = outside(CRATE, (2.0, 3.0, -4.0))
    third = 1.0 / math.sqrt(3.0)
    assert corner.distance == pytest.approx(math.sqrt(3.0))
    assert corner.normal == pytest.approx((third, third, -third))


def test_a_quarter_turn_about_down_exchanges_north_and_east() -> None:
    half = math.sqrt(0.5)
    turned = box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (half, 0.0, 0.0, half))
    assert outside(turned, (5.0, 0.0, 0.0)).distance == pytest.approx(3.0)
    assert outside(turned, (0.0, 5.0, 0.0)).distance == pytest.approx(4.0)


def test_a_room_has_six_faces_and_each_plane_stays_at_its_own() -> None:
    here, there = inside(CRATE, (0.5, 0.0, 0.0)), inside(CRATE, (-0.9, 1.0, 2.0))
    assert [at.distance for at in here] == [0.5, 1.5, 2.0, 2.0, 3.0, 3.0]
    assert [at.normal for at in here] == [at.normal for at in there]


@pytest.mark.parametrize(
    ("shape", "problem"),
    [
        (box((0.0, 0.0, 0.0), (1.0, 0.0, 1.0)), "a box has half size 0 m; > 0 is needed"),
        (
            box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.9, 0.0, 0.0, 0.0)),
            "the attitude of a box is a quaternion of length 0.9; 1 is needed",
        ),
    ],
)
def test_what_is_no_box_is_refused(shape: Shape, problem: str) -> None:
    assert kind_of(shape).check(shape) == problem
