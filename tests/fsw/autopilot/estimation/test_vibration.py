"""The vibration metrics are first-order averages of the step from one reading to the next."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.estimation.vibration import VibrationMeter
from fsw.autopilot.signals import Vec3

STILL: Vec3 = (0.0, 0.0, 0.0)


def shaken(gyro: Vec3, accel: Vec3, times: int) -> VibrationMeter:
    """After a first reading at rest, and some that jump there and back again."""
    meter = VibrationMeter()
    meter.add(STILL, STILL)
    for index in range(times):
        meter.add(*((gyro, accel) if index % 2 == 0 else (STILL, STILL)))
    return meter


def test_nothing_is_reported_before_two_readings() -> None:
    meter = VibrationMeter()
    assert meter.metrics == (0.0, 0.0)
    meter.add((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert meter.metrics == (0.0, 0.0)


def test_a_steady_reading_is_no_vibration_however_large() -> None:
    meter = VibrationMeter()
    for _ in range(10):
        meter.add((9.0, -9.0, 9.0), (0.0, 0.0, -9.81))
    assert meter.metrics == (0.0, 0.0)


@pytest.mark.parametrize("times", [1, 2, 100, 2000])
def test_the_metrics_approach_the_size_of_the_jump_by_a_hundredth_each_time(times: int) -> None:
    # |(2, 3, 6)| = 7 and |(4, 4, 2)| = 6.
    gyro, accel = shaken((2.0, 3.0, 6.0), (4.0, -4.0, 2.0), times).metrics
    grown = 1.0 - 0.99**times
    assert gyro == pytest.approx(7.0 * grown)
    assert accel == pytest.approx(6.0 * grown)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_reading_that_is_no_number_is_passed_over_in_both(value: float) -> None:
    for gyro, accel in (((value, 0.0, 0.0), STILL), (STILL, (0.0, value, 0.0))):
        meter = shaken((2.0, 3.0, 6.0), (4.0, -4.0, 2.0), 3)
        before = meter.metrics
        meter.add(gyro, accel)
        assert meter.metrics == before


def test_readings_at_an_end_of_the_range_are_counted_axis_by_axis() -> None:
    meter = VibrationMeter(accel_range=156.9)
    for accel, count in (
        ((156.9, 0.0, -9.81), 1),
        ((-156.9, 156.9, -156.9), 4),
        ((156.8, 0.0, 0.0), 5),  # within a thousandth, as PX4 counts
        ((156.7, -156.7, 0.0), 5),
        ((1e9, math.inf, math.nan), 7),
    ):
        meter.add(STILL, accel)
        assert meter.clipped == count


def test_without_a_range_nothing_is_clipped() -> None:
    meter = VibrationMeter()
    meter.add(STILL, (1e6, 0.0, 0.0))
    assert meter.clipped == 0
