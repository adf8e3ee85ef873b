"""On the ground, in the air, or neither: by height above standing and by speed."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.flight.land_detector import height_above_ground, is_low, standing_unclear, stands
from fsw.signals import Vec3
from tests.fsw.flight.in_flight import GROUND_Z, limits, vehicle_at

CONFIG = limits(landed_height=0.1, airborne_height=0.3, landed_speed=0.05)
STILL: Vec3 = (0.0, 0.0, 0.0)


def at(height: float, v: Vec3 = STILL) -> tuple[bool, bool, bool]:
    estimate = vehicle_at((5.0, -7.0, GROUND_Z - height), v)
    assert height_above_ground(CONFIG, estimate) == pytest.approx(height)
    return is_low(CONFIG, estimate), stands(CONFIG, estimate), standing_unclear(CONFIG, estimate)


@pytest.mark.requirement("REQ-ARM-5")
@pytest.mark.parametrize(
    ("height", "low", "standing", "unclear"),
    [
        (-0.5, True, True, False),
        (0.0, True, True, False),
        (0.09, True, True, False),
        (0.11, False, False, True),
        (0.29, False, False, True),
        (0.31, False, False, False),
        (20.0, False, False, False),
    ],
)
def test_at_rest_the_height_decides(
    height: float, low: bool, standing: bool, unclear: bool
) -> None:
    assert at(height) == (low, standing, unclear)


@pytest.mark.requirement("REQ-ARM-5")
@given(st.tuples(*[st.floats(-0.2, 0.2)] * 3))
def test_low_and_moving_is_unclear_whatever_the_direction(v: Vec3) -> None:
    slow = v[0] ** 2 + v[1] ** 2 + v[2] ** 2 < 0.05**2
    assert at(0.0, v) == (True, slow, not slow)


def test_at_a_limit_itself_it_is_not_low_and_no_longer_unclear() -> None:
    coarse = limits(landed_height=0.25, airborne_height=0.5, landed_speed=0.5)
    coarse = replace(coarse, airframe=replace(coarse.airframe, leg_length=0.5))
    assert not is_low(coarse, vehicle_at((0.0, 0.0, -0.75)))
    assert not standing_unclear(coarse, vehicle_at((0.0, 0.0, -1.0)))
    assert not stands(coarse, vehicle_at((0.0, 0.0, -0.5), (0.0, 0.5, 0.0)))
