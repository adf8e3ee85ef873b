"""The paper's model as a plant, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.airframe import AIRFRAME, AttitudeLag
from fsw.autopilot.model.nominal import rest_state
from fsw.autopilot.model.prediction import discretise, to_vector
from fsw.autopilot.signals import PlanInput
from sitl.scenario import Uniform, Wind
from studies.flight.double_integrator import DoubleIntegrator, after, places
from studies.paper.cases import scenario
from tests.fsw.autopilot.model.geometry_by_rotation import tips
from tests.fsw.paper_arm import LENGTHS

U = PlanInput((0.3, -0.2, 0.1), 0.05, (0.4, -0.6))
MOVING = rest_state(2)._replace(
    p=(1.0, 2.0, -3.0),
    v=(0.3, -0.1, 0.2),
    yaw=0.4,
    yaw_rate=-0.3,
    q_arm=(-0.6, 1.1),
    qd_arm=(0.2, -0.5),
)
STILL = (0.0, 0.0, 0.0)


def test_a_period_in_ticks_is_the_planners_period() -> None:
    state = MOVING
    for _ in range(50):
        state = after(state, U, STILL, 0.002)
    a, b = discretise(replace(AIRFRAME, attitude_lag=AttitudeLag(at_once=True)), 0.1)
    whole = a @ to_vector(MOVING) + b @ np.array([*U.a, U.yaw_acc, *U.qdd_arm])
    np.testing.assert_allclose(to_vector(state), whole, atol=1e-12)


def test_its_points_are_the_planners_points() -> None:
    expected = tips(np.array(MOVING.p), Rotation.from_euler("z", MOVING.yaw), (-0.6, 1.1), LENGTHS)
    base, joint1, joint2, end_effector = places(AIRFRAME.bodies, MOVING)
    assert tuple(base) == tuple(joint1) == MOVING.p
    np.testing.assert_allclose([joint2, end_effector], expected, atol=1e-14)


def test_wind_moves_it_by_half_a_t_squared() -> None:
    wind = (0.02, -0.01, 0.005)
    calm = scenario("I", disturbed=False, duration_s=1.0)
    plant = DoubleIntegrator(replace(calm, disturbances=(Wind(wind),)), seed=0)
    start = plant.state
    nothing = PlanInput(STILL, 0.0, (0.0, 0.0))
    while plant.ended is None:
        plant.advance(nothing)
    moved = np.array(plant.state.p) - start.p
    np.testing.assert_allclose(moved, 0.5 * np.array(wind) * plant.time_s**2, atol=1e-12)
    assert plant.time_s == pytest.approx(1.0)


def test_it_starts_with_the_end_effector_on_its_reference_and_the_base_in_the_centre() -> None:
    for case in ("I", "II"):
        plant = DoubleIntegrator(scenario(case, disturbed=False), seed=0)
        base, *_, end_effector = plant.places
        target = plant.clock.target_at(0.0).p
        np.testing.assert_allclose(end_effector, target, atol=1e-12)
        if case == "II":
            assert plant.evaluator.record.minimum[0] == pytest.approx(0.075, abs=1e-9)
            assert math.dist(base, (target[0], target[1], target[2] - 0.225)) < 1e-9


def test_a_seed_draws_what_it_draws_in_the_full_plant() -> None:
    disturbed = scenario("II", disturbed=True, duration_s=0.5)
    assert isinstance(disturbed.disturbances[0], Uniform)
    plants = [DoubleIntegrator(disturbed, seed) for seed in (3, 3, 4)]
    nothing = PlanInput(STILL, 0.0, (0.0, 0.0))
    for plant in plants:
        while plant.ended is None:
            plant.advance(nothing)
    same, again, other = (plant.state.p for plant in plants)
    assert same == again
    assert same != other
