"""Faults of a sensor: each is told once, at once or after it has lasted."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.estimation.faults.sensor_fault import Health, SensorFault
from fsw.autopilot.measurements import Sensor


def told(times: list[float], fault: SensorFault = SensorFault.JUMP) -> list[float]:
    """When a fault that is seen at some times [s] is told."""
    health, found = Health(Sensor.RANGEFINDER), []
    for t in times:
        health = health.with_fault(fault, t)
        if health.is_news():
            found.append(t)
        health = health.with_fault(fault, t)  # seen twice in a tick, it is one
    return found


def lasting(begin: float, end: float, apart: float) -> list[float]:
    return [begin + apart * k for k in range(round((end - begin) / apart) + 1)]


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize("apart", [0.02, 0.25, 0.9])
@pytest.mark.parametrize("after", [1.5, 3.0, 9.9])
def test_a_fault_soon_after_an_outlier_is_told_when_it_has_lasted(
    after: float, apart: float
) -> None:
    first, second = told([0.0, *lasting(after, after + 60.0, apart)])
    assert first == 0.0
    assert 1.0 <= second - after < 1.0 + apart + 1e-9


@pytest.mark.requirement("REQ-EST-1")
def test_a_fault_is_told_once_for_as_long_as_it_lasts_and_again_after_a_rest() -> None:
    assert told(lasting(5.0, 65.0, 0.05)) == [5.0]
    assert told([0.0, 3.0, 6.0, 9.0]) == [0.0], "outliers now and then"
    assert told([0.0, 10.5, 21.5]) == [0.0, 10.5, 21.5]
    again = told([*lasting(0.0, 5.0, 0.05), *lasting(8.0, 12.0, 0.05)])
    assert [round(t, 6) for t in again] == [0.0, 9.0]


def test_each_kind_of_fault_is_told_for_itself() -> None:
    health = Health(Sensor.POSE).with_fault(SensorFault.JUMP, 1.0)
    assert health.is_news()
    health = health.with_fault(SensorFault.STUCK, 1.1)
    assert health.is_news()
    assert {one.fault: one.rested for one in health.known} == {
        SensorFault.JUMP: math.inf,
        SensorFault.STUCK: math.inf,
    }
