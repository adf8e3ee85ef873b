"""The height loop's signs (z points down) and its share of gravity."""

from __future__ import annotations

import math

import pytest
from scipy.spatial.transform import Rotation

from fsw.control.gains import InnerTuning
from fsw.control.height import height_pid
from fsw.model.airframe import AIRFRAME, GRAVITY
from fsw.signals import PlanInput, PredictionState, StateEstimate
from tests.fsw.random_states import estimate_of

GAINS = InnerTuning().height
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
