"""The arm's points against chained rotations, their velocities against their motion."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.kinematics import arm_points, end_effector_when_level, point_in_flight
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import INPUTS, Q_ARM, STATES, Array, condense
from fsw.autopilot.signals import StateEstimate, Vec2
from tests.fsw.autopilot.model.geometry_by_rotation import moved_on, tips, tips_of_prediction
from tests.fsw.random_states import estimate_of, prediction_vector, random_estimate

LENGTHS = np.array([0.15, 0.12])  # unequal, so that exchanged links show
MOMENT = 1e-5  # s


def predicted(x: Array) -> Array:
    """[joint 2 | end-effector][position | velocity][axis]."""
    out = np.zeros((2, 2, 3))
    arm_points(x, LENGTHS[0], LENGTHS[1], out)
    return out


def test_predicted_points_equal_the_chained_rotations() -> None:
    random = np.random.default_rng(1)
    for _ in range(100):
        x = prediction_vector(random)
        np.testing.assert_allclose(predicted(x)[:, 0], tips_of_prediction(x, LENGTHS), atol=1e-12)


def test_predicted_velocities_are_the_rate_of_the_points_along_the_motion() -> None:
    random = np.random.default_rng(2)
    for _ in range(100):
        x = prediction_vector(random)
        after = tips_of_prediction(moved_on(x, MOMENT), LENGTHS)
        before = tips_of_prediction(moved_on(x, -MOMENT), LENGTHS)
        np.testing.assert_allclose(
            predicted(x)[:, 1], (after - before) / (2.0 * MOMENT), atol=1e-6, rtol=1e-6
        )


def test_accelerating_forward_swings_the_hanging_arm_backward() -> None:
    x = np.zeros(STATES)
    x[6] = 2.0  # pitches the nose down: thrust leans forward, the arm's tip goes back
    assert predicted(x)[1, 0, 0] < -0.04
    x[6:8] = 0.0, 2.0
    assert predicted(x)[1, 0, 1] < -0.04


def test_measured_points_equal_the_chained_rotations() -> None:
    random = np.random.default_rng(3)
    for _ in range(100):
        estimate = random_estimate(random)
        joint2, end_effector = in_flight_by_rotation(estimate, 0.0)
        np.testing.assert_allclose(point_in_flight(estimate, (0.15, 0.0))[0], joint2, atol=1e-12)
        np.testing.assert_allclose(
            point_in_flight(estimate, (0.15, 0.12))[0], end_effector, atol=1e-12
        )


def test_measured_velocities_are_the_rate_of_the_points_along_the_motion() -> None:
    random = np.random.default_rng(4)
    lengths: tuple[Vec2, Vec2] = ((0.15, 0.0), (0.15, 0.12))
    for _ in range(100):
        estimate = random_estimate(random)
        after = in_flight_by_rotation(estimate, MOMENT)
        before = in_flight_by_rotation(estimate, -MOMENT)
        for point, length in enumerate(lengths):
            np.testing.assert_allclose(
                point_in_flight(estimate, length)[1],
                (after[point] - before[point]) / (2.0 * MOMENT),
                atol=1e-7,
            )


def in_flight_by_rotation(estimate: StateEstimate, t: float) -> Array:
    """Joint 2 and end-effector (2, 3) a moment later, everything moving at its present rate."""
    R_WB = Rotation.from_matrix(np.reshape(estimate.R_WB, (3, 3)))
    turned = R_WB * Rotation.from_rotvec(t * np.array(estimate.w_WB_B))
    p = np.array(estimate.p_WB) + t * np.array(estimate.v_WB)
    q_arm = np.array(estimate.q_arm) + t * np.array(estimate.qd_arm)
    return tips(p, turned, q_arm, LENGTHS)


def test_first_joint_turns_the_hanging_arm_forward() -> None:
    level = estimate_of(Rotation.identity(), q_arm=(0.5, 0.0), qd_arm=(1.0, 0.0))
    p_WE, v_WE = point_in_flight(level, (0.15, 0.15))
    assert p_WE[0] > 0.1
    assert v_WE[0] > 0.2
    assert v_WE[2] < 0.0  # and up


def test_centre_of_gravity_is_the_mass_weighted_mean_of_the_links() -> None:
    random = np.random.default_rng(5)
    horizon = Linearisation(condense(AIRFRAME, 0.1, 1))
    m1, m2 = AIRFRAME.link_mass
    for _ in range(20):
        q1, q2 = (float(q) for q in random.uniform(-1.5, 1.5, 2))
        level = estimate_of(Rotation.identity(), q_arm=(q1, q2))
        com1 = point_in_flight(level, (AIRFRAME.link_com[0], 0.0))[0][0]
        com2 = point_in_flight(level, (AIRFRAME.link_length[0], AIRFRAME.link_com[1]))[0][0]
        mean = (m1 * com1 + m2 * com2) / (m1 + m2)
        start = np.zeros(STATES)
        start[Q_ARM : Q_ARM + 2] = q1, q2
        horizon.refill(start, np.zeros(INPUTS))
        assert math.isclose(float(horizon.tracked.arm_com[0]), mean, abs_tol=1e-12)


def test_a_level_vehicle_has_its_end_effector_where_the_chained_rotations_put_it() -> None:
    random = np.random.default_rng(12)
    for _ in range(50):
        yaw, th1, th2 = random.uniform((-3.0, -1.0, -1.5), (3.0, 1.0, 1.5)).tolist()
        level = Rotation.from_euler("z", yaw)
        expected = tips(np.zeros(3), level, np.array((th1, th2)), LENGTHS)[1]
        np.testing.assert_allclose(
            end_effector_when_level((0.15, 0.12), (th1, th2), yaw), expected, atol=1e-12
        )
