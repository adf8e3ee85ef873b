"""The arm's torques against Pinocchio and against its own motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.gains import LoopGains
from fsw.autopilot.control.joints import (
    joint_torques,
    limit_acceleration,
    observe_disturbance,
    rest_joints,
)
from fsw.autopilot.control.pid import PidGains
from fsw.autopilot.control.press import PressTuning
from fsw.autopilot.model.airframe import AIRFRAME, Airframe
from fsw.autopilot.model.arm_coordinates import arm_coordinates
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import StateEstimate, Vec2, Vec3
from fsw.autopilot.tick_record import ArmTask, Joints, Tick
from fsw.record import JOINTS
from tests.fsw.paper_arm import LENGTHS, LIMIT1, LIMIT12
from tests.fsw.random_states import estimate_of
from tests.fsw.records import boundless, changed, placed

ARM = arm_coordinates(AIRFRAME)
GAINS = LoopGains().joint
WITH_INTEGRAL = replace(GAINS, ki=400.0)
FIELD = (0.0, 9.81)
DOWN = (0.0, 0.0, 9.81)
DT = 0.002


def planar_arm(airframe: Airframe = AIRFRAME, field: Vec2 = FIELD) -> Any:
    """Two links that turn about +y and hang along +z, in a field along x and z."""
    model = pin.Model()
    model.gravity.linear = np.array([field[0], 0.0, field[1]])
    parent, place = 0, pin.SE3.Identity()
    for link in range(2):
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"joint{link}")
        inertia = pin.Inertia(
            airframe.bodies.mass[link],
            np.array(airframe.bodies.com[3 * link : 3 * link + 3]),
            np.diag(airframe.bodies.inertia[6 * link : 6 * link + 3]),
        )
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, LENGTHS[link]]))
    return model


def moving(random: np.random.Generator, pitch_rate: float) -> StateEstimate:
    q, qd = random.uniform(-2.0, 2.0, 2), random.uniform(-5.0, 5.0, 2)
    return estimate_of(Rotation.identity(), (0.0, pitch_rate, 0.0), q_arm=pair(q), qd_arm=pair(qd))


def test_a_raised_arm_is_held_up() -> None:
    """Forward of the hanging position the torque must keep pushing forward."""
    raised = estimate_of(Rotation.identity(), q_arm=(0.5, 0.0))
    torque, _ = hold(raised.q_arm, (0.5, 0.0))
    assert torque[0] > 0.1
    assert torque[1] > 0.02


def hold(q: Vec2, q_ref: Vec2, thrust: float = 9.81, pitch: float = 0.0) -> tuple[Vec2, Vec2]:
    """Torques and integrals of an arm at rest that is asked to rest elsewhere."""
    estimate = estimate_of(Rotation.identity(), q_arm=q)
    r = resting(AIRFRAME, estimate, reference=q_ref)
    return asked(r, AIRFRAME, GAINS, (0.0, 0.0, thrust), pitch), pair(r.joints.integral)


def asked(r: Tick, airframe: Airframe, gains: PidGains, field: Vec3, pitch: float = 0.0) -> Vec2:
    """Torques of the joints in a field, the base having an angular acceleration in pitch."""
    joint_torques(
        r, airframe, arm_coordinates(airframe), gains, PressTuning(), field, (0.0, pitch, 0.0), DT
    )
    return pair(r.wanted.joint_torque)


def resting(airframe: Airframe, estimate: StateEstimate, **fields: Any) -> Tick:
    """A record of joints that rest at an estimate, but for other fields."""
    r = placed(airframe, estimate)
    rest_joints(r.joints, airframe, estimate)
    r.joints = changed(r.joints, **fields)
    return r


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_each_joint_is_pushed_towards_its_reference(joint: int, sign: float) -> None:
    q_ref = [0.0, 0.0]
    q_ref[joint] = sign * 0.02
    torque, integral = hold((0.0, 0.0), (q_ref[0], q_ref[1]))
    assert sign * torque[joint] > 0.0
    assert sign * integral[joint] > 0.0, "kept, for those who set an integral gain"


def test_pitching_the_base_up_is_followed_by_the_first_joint() -> None:
    """A link that keeps its place in the pitching body must be turned with it."""
    still, turning = hold((0.0, 0.0), (0.0, 0.0)), hold((0.0, 0.0), (0.0, 0.0), pitch=5.0)
    assert turning[0][0] > still[0][0] + 0.01


def test_torques_keep_the_servos_limit() -> None:
    torque, _ = hold((0.0, 0.0), (3.0, 3.0), thrust=200.0)
    assert max(map(abs, torque)) <= AIRFRAME.joint_torque_max[0]


def followed(
    start: Vec2,
    references: Callable[[float], tuple[Vec2, Vec2]],
    seconds: float,
    friction: float = 0.0,
    push: Callable[[float], Vec2] = lambda _: (0.0, 0.0),
) -> tuple[Array, Array]:
    """Angles and rates after every tick, Pinocchio's forward dynamics as the plant.

    Dry friction in both joints, and a torque that the law does not know of.
    """
    model = planar_arm()
    data = model.createData()
    q, qd, torque = np.array(start), np.zeros(2), (0.0, 0.0)
    k = resting(AIRFRAME, estimate_of(Rotation.identity(), q_arm=start)).joints
    angles, rates = [], []
    for tick in range(round(seconds / DT)):
        estimate = estimate_of(Rotation.identity(), q_arm=pair(q), qd_arm=pair(qd))
        r = placed(AIRFRAME, estimate)
        r.joints = k
        observe_disturbance(r, AIRFRAME, torque, DOWN, DT)
        k = r.joints
        k.reference[:2], k.reference_rate[:2] = references(tick * DT)
        r.joints = k
        torque = asked(r, AIRFRAME, GAINS, DOWN)
        k = r.joints
        for _ in range(8):
            dry = friction * np.tanh(qd / 0.05)
            qd = qd + DT / 8.0 * np.array(
                pin.aba(model, data, q, qd, np.array(torque) - dry + push(tick * DT))
            )
            q = q + DT / 8.0 * qd
        angles.append(q)
        rates.append(qd)
    return np.array(angles), np.array(rates)


def at(q: Vec2) -> Callable[[float], tuple[Vec2, Vec2]]:
    return lambda _: (q, (0.0, 0.0))


@pytest.mark.long
def test_in_closed_loop_the_arm_settles_on_its_reference_whatever_friction_there_is() -> None:
    for friction in (0.0, 0.01, 0.03):
        angles, _ = followed((0.3, -0.8), at((-0.5, 1.0)), 1.5, friction)
        assert math.dist(angles[-1], (-0.5, 1.0)) < 4e-3, friction


def test_a_steady_torque_that_nothing_told_of_is_taken_off_within_two_tenths_of_a_second() -> None:
    pushed = 0.05  # N m, half a second; the integral alone would need seconds
    angles, _ = followed(
        (0.4, 0.6), at((0.4, 0.6)), 0.6, push=lambda t: (pushed, pushed) if t > 0.1 else (0, 0)
    )
    off = np.abs(angles - [0.4, 0.6]).max(axis=1)
    assert off[round(0.1 / DT) :].max() > 5e-3, "it is a push"
    assert off[round(0.3 / DT) :].max() < 5e-3


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-ACT-8")
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("far", [(2.0, -2.0), (0.2, 3.0), (2.0, 2.0)])
def test_no_reference_takes_the_arm_past_a_limit_of_an_angle_or_a_rate(
    far: Vec2, sign: float
) -> None:
    """Not even one that jumps far beyond: the loop itself keeps them, with friction too."""
    start = (-0.3 * sign, 0.4 * sign)
    goal = (sign * far[0], sign * far[1])
    angles, rates = followed(start, at(goal), 1.5, friction=0.01)
    links = np.abs(np.column_stack((angles[:, 0], angles.sum(axis=1))))
    assert (links.max(axis=0) > [0.95 * LIMIT1, 0.95 * LIMIT12]).any(), "or it was no test"
    assert links[:, 0].max() < LIMIT1 + math.radians(0.5)
    assert links[:, 1].max() < LIMIT12 + math.radians(0.5)
    assert np.abs(rates).max() < AIRFRAME.joint_rate_max[0] + 0.1


def test_far_from_limits_accelerations_are_as_wanted_and_near_them_point_back() -> None:
    assert limited((0.1, -0.2), (0.5, -0.5), (40.0, -60.0)) == [40.0, -60.0]
    beyond = (LIMIT1 + 0.02, -0.3)
    assert limited(beyond, (0.0, 0.0), (40.0, 0.0))[0] < 0.0
    q = (0.2, LIMIT12 - 0.2 + 0.02)
    assert sum(limited(q, (0.0, 0.0), (10.0, 50.0))) < 0.0


def limited(q: Vec2, qd: Vec2, qdd: Vec2) -> list[float]:
    found = np.array(qdd)
    limit_acceleration(AIRFRAME, ARM, ArmTask(), np.array(q), np.array(qd), found)
    return [float(value) for value in found]


def test_the_errors_of_both_joints_obey_their_own_pid_whatever_the_arm_does() -> None:
    """Computed torque, seen through Pinocchio's forward dynamics of an arm of two unlike links."""
    unlike = replace(
        boundless(AIRFRAME, 1e3),
        bodies=replace(
            AIRFRAME.bodies,
            mass=(0.3, 0.15, *(0.0,) * 4),
            com=(0.0, 0.0, 0.06, 0.0, 0.0, 0.09, *(0.0,) * 12),
        ),
        joint_torque_max=(1e3,) * JOINTS,
        joint_rate_max=(1e3,) * JOINTS,
    )
    model, random = planar_arm(unlike), np.random.default_rng(7)
    data, far = model.createData(), replace(WITH_INTEGRAL, limit=1e9)
    for _ in range(50):
        q, error = random.uniform(-1.0, 1.0, (2, 2)) * [[1.0], [0.02]]
        qd, error_rate, integral, qdd = random.uniform(-1.0, 1.0, (4, 2)) * 0.5
        pitch_rate, pitch_acceleration = (float(x) for x in random.uniform(-2.0, 2.0, 2))
        estimate = estimate_of(
            Rotation.identity(), (0.0, pitch_rate, 0.0), q_arm=pair(q), qd_arm=pair(qd)
        )
        r = placed(unlike, estimate)
        r.joints = changed(
            Joints(), integral=integral, reference=q + error, reference_rate=qd + error_rate
        )
        r.flown_u.qdd_arm[:2] = qdd
        torque = asked(r, unlike, far, DOWN, pitch_acceleration)
        kept = r.joints.integral[:2]
        inertial = qd + [pitch_rate, 0.0]
        got = pin.aba(model, data, q, inertial, np.array(torque)) - [pitch_acceleration, 0.0]
        np.testing.assert_allclose(kept, integral + DT * error, atol=1e-12)
        pid = far.kp * error + far.ki * kept + far.kd * error_rate
        np.testing.assert_allclose(got, qdd + pid, atol=1e-6)


def test_motors_behind_gears_are_moved_along_and_known_to_the_momentum() -> None:
    """With what each motor adds, I times how its joint turns, the same PID errors come out."""
    inertia = 0.0025
    alone = replace(
        boundless(AIRFRAME, 1e3),
        joint_torque_max=(1e3,) * JOINTS,
        joint_rate_max=(1e3,) * JOINTS,
    )
    motors = replace(alone, joint_armature=inertia)
    model, random = planar_arm(motors), np.random.default_rng(8)
    data, gains = model.createData(), replace(GAINS, ki=0.0, limit=1e9)
    for _ in range(20):
        pitch_rate = float(random.uniform(-2.0, 2.0))
        estimate = moving(random, pitch_rate)
        pitch_acceleration, qdd = 5.0, pair(random.uniform(-5.0, 5.0, 2))
        r = placed(motors, estimate)
        r.joints = changed(Joints(), reference=estimate.q_arm, reference_rate=estimate.qd_arm)
        r.flown_u.qdd_arm[:2] = qdd
        torque = asked(r, motors, gains, DOWN, pitch_acceleration)
        q, qd = np.array(estimate.q_arm), np.array(estimate.qd_arm)
        inertial = qd + [pitch_rate, 0.0]
        links = pin.rnea(model, data, q, inertial, np.array(qdd) + [pitch_acceleration, 0.0])
        np.testing.assert_allclose(torque, links + inertia * np.array(qdd), atol=1e-9)
        without = placed(alone, estimate).bodies
        np.testing.assert_allclose(
            (r.bodies.momentum - without.momentum)[:2], inertia * qd, atol=1e-12
        )
        np.testing.assert_array_equal(r.bodies.drift, without.drift)


def pair(values: Any) -> Vec2:
    return float(values[0]), float(values[1])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_torque_beyond_the_servos_limit_becomes_the_limit(sign: float) -> None:
    weak = replace(AIRFRAME, joint_torque_max=(0.1,) * JOINTS)
    still = estimate_of(Rotation.identity())
    r = resting(weak, still, reference=(3.0 * sign, 3.0 * sign))
    assert asked(r, weak, GAINS, (0.0, 0.0, 0.0)) == (0.1 * sign, 0.1 * sign)
