"""The arm's torques against Pinocchio and against its own motion."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from fsw.control.gains import LoopGains
from fsw.control.joints import arm_inverse_dynamics, joint_torques
from fsw.model.airframe import AIRFRAME, Airframe
from fsw.signals import Vec2
from tests.fsw.random_states import estimate_of

GAINS = LoopGains().joint
FIELD = 9.81


def planar_arm(airframe: Airframe = AIRFRAME) -> Any:
    """Two links that turn about +y and hang along +z, in a field along +z."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, FIELD])
    parent, place = 0, pin.SE3.Identity()
    for link in range(2):
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"joint{link}")
        inertia = pin.Inertia(
            airframe.link_mass[link],
            np.array([0.0, 0.0, airframe.link_com[link]]),
            np.diag([1e-5, airframe.link_inertia[link], 1e-5]),
        )
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, airframe.link_length[link]]))
    return model


def test_inverse_dynamics_equal_recursive_newton_euler() -> None:
    random, model = np.random.default_rng(1), planar_arm()
    data = model.createData()
    for _ in range(200):
        q, qd, qdd = random.uniform(-2.0, 2.0, 2), *random.uniform(-5.0, 5.0, (2, 2))
        pitch_rate = float(random.uniform(-3.0, 3.0))
        estimate = estimate_of(
            Rotation.identity(),
            (0.0, pitch_rate, 0.0),
            q_arm=(float(q[0]), float(q[1])),
            qd_arm=(float(qd[0]), float(qd[1])),
        )
        torque = arm_inverse_dynamics(AIRFRAME, estimate, (qdd[0], qdd[1]), FIELD)
        # To an inertial frame the first link turns with the base as well.
        expected = pin.rnea(model, data, q, qd + np.array([pitch_rate, 0.0]), qdd)
        np.testing.assert_allclose(torque, expected, atol=1e-12)


def test_a_raised_arm_is_held_up() -> None:
    """Forward of the hanging position the torque must keep pushing forward."""
    raised = estimate_of(Rotation.identity(), q_arm=(0.5, 0.0))
    torque, _ = hold(raised.q_arm, (0.5, 0.0))
    assert torque[0] > 0.1
    assert torque[1] > 0.02


def hold(q: Vec2, q_ref: Vec2, thrust: float = FIELD, pitch: float = 0.0) -> tuple[Vec2, Vec2]:
    estimate = estimate_of(Rotation.identity(), q_arm=q)
    reference = (q_ref, (0.0, 0.0), (0.0, 0.0))
    return joint_torques(AIRFRAME, GAINS, (0.0, 0.0), estimate, reference, thrust, pitch, 0.002)


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_each_joint_is_pushed_towards_its_reference(joint: int, sign: float) -> None:
    q_ref = [0.0, 0.0]
    q_ref[joint] = sign * 0.02
    torque, integral = hold((0.0, 0.0), (q_ref[0], q_ref[1]))
    assert sign * torque[joint] > 0.0
    assert sign * integral[joint] > 0.0


def test_pitching_the_base_up_is_followed_by_the_first_joint() -> None:
    """A link that keeps its place in the pitching body must be turned with it."""
    still, turning = hold((0.0, 0.0), (0.0, 0.0)), hold((0.0, 0.0), (0.0, 0.0), pitch=5.0)
    assert turning[0][0] > still[0][0] + 0.01


def test_torques_keep_the_servos_limit() -> None:
    torque, _ = hold((0.0, 0.0), (3.0, 3.0), thrust=200.0)
    assert max(map(abs, torque)) <= AIRFRAME.joint_torque_max


def test_in_closed_loop_the_arm_settles_on_its_reference() -> None:
    """Pinocchio's forward dynamics as the plant, with friction the law does not know of."""
    model = planar_arm()
    data = model.createData()
    q, qd, integral = np.array([0.3, -0.8]), np.zeros(2), (0.0, 0.0)
    dt = 0.002
    for _ in range(4000):
        estimate = estimate_of(Rotation.identity(), q_arm=(q[0], q[1]), qd_arm=(qd[0], qd[1]))
        reference = ((-0.5, 1.0), (0.0, 0.0), (0.0, 0.0))
        torque, integral = joint_torques(
            AIRFRAME, GAINS, integral, estimate, reference, FIELD, 0.0, dt
        )
        qd = qd + dt * np.array(pin.aba(model, data, q, qd, np.array(torque) - 0.02 * qd))
        q = q + dt * qd
    assert math.dist(q, (-0.5, 1.0)) < 2e-3


def test_the_errors_of_both_joints_obey_their_own_pid_whatever_the_arm_does() -> None:
    """Computed torque, seen through Pinocchio's forward dynamics of an arm of two unlike links."""
    unlike = replace(AIRFRAME, link_mass=(0.3, 0.15), link_com=(0.06, 0.09), joint_torque_max=1e3)
    model, random = planar_arm(unlike), np.random.default_rng(7)
    data, far = model.createData(), replace(GAINS, limit=1e9)
    for _ in range(50):
        q, error = random.uniform(-1.0, 1.0, (2, 2)) * [[1.0], [0.02]]
        qd, error_rate, integral, qdd = random.uniform(-1.0, 1.0, (4, 2)) * 0.5
        pitch_rate, pitch_acceleration = (float(x) for x in random.uniform(-2.0, 2.0, 2))
        estimate = estimate_of(
            Rotation.identity(), (0.0, pitch_rate, 0.0), q_arm=pair(q), qd_arm=pair(qd)
        )
        torque, kept = joint_torques(
            unlike,
            far,
            pair(integral),
            estimate,
            (pair(q + error), pair(qd + error_rate), pair(qdd)),
            FIELD,
            pitch_acceleration,
            0.002,
        )
        inertial = qd + [pitch_rate, 0.0]
        got = pin.aba(model, data, q, inertial, np.array(torque)) - [pitch_acceleration, 0.0]
        np.testing.assert_allclose(kept, integral + 0.002 * error, atol=1e-12)
        pid = GAINS.kp * error + GAINS.ki * np.array(kept) + GAINS.kd * error_rate
        np.testing.assert_allclose(got, qdd + pid, atol=1e-6)


def pair(values: Any) -> Vec2:
    return float(values[0]), float(values[1])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_torque_beyond_the_servos_limit_becomes_the_limit(sign: float) -> None:
    weak = replace(AIRFRAME, joint_torque_max=0.1)
    still = estimate_of(Rotation.identity())
    reference = ((3.0 * sign, 3.0 * sign), (0.0, 0.0), (0.0, 0.0))
    limited, _ = joint_torques(weak, GAINS, (0.0, 0.0), still, reference, 0.0, 0.0, 0.002)
    assert limited == (0.1 * sign, 0.1 * sign)
