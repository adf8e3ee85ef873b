"""Places of vehicles of any arm against Pinocchio, and against their own motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.airframe import AIRFRAME, Airframe, airframe_of
from fsw.autopilot.model.kinematics import (
    end_effector,
    end_effector_when_level,
    frame_of,
    in_body,
    position,
    predicted_end_effector,
    velocity,
)
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Q_ARM, Array, condense, inputs_of, states_of
from fsw.autopilot.signals import StateEstimate
from tests.fsw.autopilot.model.geometry_by_rotation import attitude, moved_on, tips
from tests.fsw.paper_arm import LENGTHS
from tests.fsw.random_states import any_estimate, estimate_of, prediction_vector, vec3
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from tests.vehicles.random_vehicles import random_vehicle
from vehicles.description import Vehicle

MOMENT = 1e-5  # s


class Referee:
    """Pinocchio's places of a vehicle, by its description alone."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.model = pinocchio_model(vehicle)
        self.data = self.model.createData()

    def places(self, p: Array, rotation: Rotation, q_arm: Array) -> list[Any]:
        """Of base and links."""
        x, y, z, w = rotation.as_quat()
        q = configuration(p, np.array((w, x, y, z)), q_arm)
        pin.forwardKinematics(self.model, self.data, q)
        return [pin.SE3(place) for place in list(self.data.oMi)[1:]]  # not views of its memory


def at_a_moment(referee: Referee, estimate: StateEstimate, t: float) -> list[Any]:
    """Base and links a moment later, everything moving at its present rate."""
    R_WB = Rotation.from_matrix(np.reshape(estimate.R_WB, (3, 3)))
    return referee.places(
        np.array(estimate.p_WB) + t * np.array(estimate.v_WB),
        R_WB * Rotation.from_rotvec(t * np.array(estimate.w_WB_B)),
        np.array(estimate.q_arm) + t * np.array(estimate.qd_arm),
    )


@pytest.mark.drawn(3)
@pytest.mark.parametrize("joints", range(1, 7))
def test_places_and_velocities_are_pinocchios_whatever_the_axes(joints: int) -> None:
    random = np.random.default_rng(joints)
    for _ in range(10):
        vehicle = random_vehicle(random, joints)
        bodies, referee = airframe_of(vehicle).bodies, Referee(vehicle)
        for _ in range(10):
            estimate = any_estimate(random, joints)
            frame = frame_of(bodies, estimate)
            here, after, before = (at_a_moment(referee, estimate, t) for t in (0, MOMENT, -MOMENT))
            for on in range(joints + 1):
                local = vec3(random.uniform(-0.3, 0.3, 3))
                np.testing.assert_allclose(
                    position(frame, on, local), here[on].act(np.array(local)), atol=1e-12
                )
                moved = after[on].act(np.array(local)) - before[on].act(np.array(local))
                np.testing.assert_allclose(
                    velocity(frame, on, local), moved / (2.0 * MOMENT), atol=1e-6
                )
                place, _ = in_body(frame, on, local)
                seen = here[0].actInv(here[on].act(np.array(local)))
                np.testing.assert_allclose(place, seen, atol=1e-12)
            p, v = end_effector(bodies, estimate)
            assert p == position(frame, joints, bodies.tip)
            assert v == velocity(frame, joints, bodies.tip)


@pytest.mark.drawn(3)
@pytest.mark.parametrize("joints", range(1, 7))
def test_a_predicted_end_effector_is_pinocchios_and_moves_as_it_does(joints: int) -> None:
    random = np.random.default_rng(joints)
    for _ in range(20):
        vehicle = random_vehicle(random, joints)
        airframe, referee = airframe_of(vehicle), Referee(vehicle)
        x = prediction_vector(random, joints)

        def tip(x: Array, airframe: Airframe = airframe, referee: Referee = referee) -> Array:
            placed = referee.places(x[0:3], attitude(x[6:9], x[13]), x[15::2])[-1]
            return np.array(placed.act(np.array(airframe.bodies.tip)))

        p, v = predicted_end_effector(airframe.bodies, x)
        np.testing.assert_allclose(p, tip(x), atol=1e-12)
        moved = tip(moved_on(x, MOMENT)) - tip(moved_on(x, -MOMENT))
        np.testing.assert_allclose(v, moved / (2.0 * MOMENT), atol=1e-6, rtol=1e-6)


def test_accelerating_forward_swings_the_hanging_arm_backward() -> None:
    bodies = AIRFRAME.bodies
    x = np.zeros(states_of(2))
    x[6] = 2.0  # pitches the nose down: thrust leans forward, the arm's tip goes back
    assert predicted_end_effector(bodies, x)[0][0] < -0.04
    x[6:8] = 0.0, 2.0
    assert predicted_end_effector(bodies, x)[0][1] < -0.04


def test_first_joint_turns_the_hanging_arm_forward() -> None:
    level = estimate_of(Rotation.identity(), q_arm=(0.5, 0.0), qd_arm=(1.0, 0.0))
    p_WE, v_WE = end_effector(AIRFRAME.bodies, level)
    assert p_WE[0] > 0.1
    assert v_WE[0] > 0.2
    assert v_WE[2] < 0.0  # and up


@pytest.mark.drawn(3)
@pytest.mark.parametrize("joints", range(1, 7))
def test_centre_of_gravity_is_the_mass_weighted_mean_of_the_links(joints: int) -> None:
    random = np.random.default_rng(joints)
    for _ in range(10):
        vehicle = random_vehicle(random, joints)
        horizon = Linearisation(condense(airframe_of(vehicle), 0.1, 1))
        x = prediction_vector(random, joints)
        placed = Referee(vehicle).places(np.zeros(3), Rotation.identity(), x[Q_ARM::2])[1:]
        links = [joint.link for joint in vehicle.joints]
        moment = sum(
            link.mass * at.act(np.array(link.com)) for link, at in zip(links, placed, strict=True)
        )
        horizon.refill(x, np.zeros(inputs_of(joints)))
        mean = moment / sum(link.mass for link in links)
        np.testing.assert_allclose(horizon.tracked.arm_com[0], mean[:2], atol=1e-12)


def test_of_the_arm_of_paper_it_is_that_of_eq_19() -> None:
    random, (m1, m2) = np.random.default_rng(5), (0.2, 0.2)
    horizon = Linearisation(condense(AIRFRAME, 0.1, 1))
    for _ in range(20):
        q1, q2 = (float(q) for q in random.uniform(-1.5, 1.5, 2))
        first, second = 0.15 * math.sin(q1), 0.15 * math.sin(q1 + q2)
        mean = (m1 * first / 2.0 + m2 * (first + second / 2.0)) / (m1 + m2)
        start = np.zeros(states_of(2))
        start[Q_ARM::2] = q1, q2
        horizon.refill(start, np.zeros(inputs_of(2)))
        np.testing.assert_allclose(horizon.tracked.arm_com[0], (mean, 0.0), atol=1e-12)


def test_a_level_vehicle_has_its_end_effector_where_the_chained_rotations_put_it() -> None:
    random = np.random.default_rng(12)
    for _ in range(50):
        yaw, th1, th2 = random.uniform((-3.0, -1.0, -1.5), (3.0, 1.0, 1.5)).tolist()
        level = Rotation.from_euler("z", yaw)
        expected = tips(np.zeros(3), level, np.array((th1, th2)), np.array(LENGTHS))[1]
        np.testing.assert_allclose(
            end_effector_when_level(AIRFRAME.bodies, (th1, th2), yaw), expected, atol=1e-12
        )
