"""The flight software, or its planner, stands still in flight beside walls, and goes on."""

from __future__ import annotations

import random

import pytest

from tests.closed_loop.pauses import fly_paused


def flown(seed: int, pause_s: float, *, planner_only: bool = False) -> None:
    at_s = random.Random(seed).uniform(3.0, 20.0)
    outcome = fly_paused("walls", seed, at_s, pause_s, planner_only=planner_only)
    assert outcome.contact == "", outcome.texts
    # A fault of the process is none of a sensor.
    assert not [text for _, text in outcome.texts if "IMU" in text or "encoders" in text]


@pytest.mark.long
def test_half_a_second_without_the_flight_software_costs_no_contact() -> None:
    flown(1, 0.5)


@pytest.mark.long
def test_half_a_second_without_plans_costs_no_contact() -> None:
    flown(1, 0.5, planner_only=True)


@pytest.mark.long
@pytest.mark.parametrize("pause_s", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("seed", range(2, 12))
def test_short_pauses_at_random_instants_cost_no_contact(seed: int, pause_s: float) -> None:
    flown(seed, pause_s)
    flown(seed, pause_s, planner_only=True)
