"""The height loop's signs (z points down) and its share of gravity."""

from __future__ import annotations

import math

import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.gains import LoopGains
from fsw.autopilot.control.pid import height_pid
from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY
from fsw.autopilot.signals import PlanInput, PredictionState, StateEstimate
from tests.fsw.random_states import estimate_of

GAINS = LoopGains().height
WEIGHT = AIRFRAME.mass * GRAVITY
PLAN = PredictionState(
    (0.0, 0.0, -1.0),
    (0.0,) * 3,
    (0.0,) * 3,
    (0.0, 0.0),
    (0.0, 0.0),
    0.0,
    0.0,
    (0.0, 0.0),
    (0.0, 0.0),
)


def thrust(estimate: StateEstimate, a_z: float = 0.0) -> float:
    u = PlanInput((0.0, 0.0, a_z), 0.0, (0.0, 0.0))
    return height_pid(AIRFRAME, GAINS, 0.0, estimate, PLAN, u, 0.002)[0]


LEVEL = Rotation.identity()


def test_on_the_plan_the_weight_is_carried() -> None:
    assert thrust(estimate_of(LEVEL)) == pytest.approx(WEIGHT)


def test_too_low_or_sinking_asks_for_more() -> None:
    assert thrust(estimate_of(LEVEL, p_WB=(0.0, 0.0, -0.8))) > WEIGHT + 1.0
    assert thrust(estimate_of(LEVEL, v_WB=(0.0, 0.0, 0.5))) > WEIGHT + 1.0


def test_too_high_or_climbing_asks_for_less() -> None:
    assert thrust(estimate_of(LEVEL, p_WB=(0.0, 0.0, -1.2))) < WEIGHT - 1.0
    assert thrust(estimate_of(LEVEL, v_WB=(0.0, 0.0, -0.5))) < WEIGHT - 1.0


def test_a_planned_climb_is_fed_forward() -> None:
    assert thrust(estimate_of(LEVEL), a_z=-1.0) == pytest.approx(WEIGHT + AIRFRAME.mass)


def test_tilted_the_vertical_part_still_carries_the_weight() -> None:
    tilted = estimate_of(Rotation.from_euler("Y", 0.5))
    assert thrust(tilted) * math.cos(0.5) == pytest.approx(WEIGHT)


def test_a_sideways_vehicle_asks_for_a_finite_thrust() -> None:
    assert thrust(estimate_of(Rotation.from_euler("X", 1.6))) <= 2.0 * WEIGHT + 1e-9


def test_only_the_vertical_parts_of_plan_and_vehicle_count() -> None:
    sideways = estimate_of(LEVEL, p_WB=(3.0, -4.0, -1.0), v_WB=(1.0, -2.0, 0.0))
    u = PlanInput((1.5, -2.5, 0.0), 0.0, (0.0, 0.0))
    plan = PLAN._replace(p=(7.0, 8.0, -1.0), v=(0.7, -0.6, 0.0))
    assert height_pid(AIRFRAME, GAINS, 0.0, sideways, plan, u, 0.002)[0] == pytest.approx(WEIGHT)


def test_a_plan_that_sinks_as_fast_as_the_vehicle_is_followed() -> None:
    sinking = estimate_of(LEVEL, v_WB=(0.0, 0.0, 0.4))
    u = PlanInput((0.0, 0.0, 0.0), 0.0, (0.0, 0.0))
    plan = PLAN._replace(v=(0.3, 0.2, 0.4))
    assert height_pid(AIRFRAME, GAINS, 0.0, sinking, plan, u, 0.002)[0] == pytest.approx(WEIGHT)


@pytest.mark.parametrize("tilt", [60.1, 75.0, 90.0, 120.0, 180.0])
def test_beyond_sixty_degrees_thrust_is_doubled_and_not_more(tilt: float) -> None:
    leaning = estimate_of(Rotation.from_euler("X", math.radians(tilt)))
    assert thrust(leaning) == pytest.approx(2.0 * WEIGHT)
