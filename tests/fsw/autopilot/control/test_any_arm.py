"""What arms of any joints are asked for: places held, limits kept."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.control.arm_compensation import CompensationLimits
from fsw.autopilot.control.joint_reference import JointReferenceLimits
from fsw.autopilot.control.joints import limit_acceleration
from fsw.autopilot.model.airframe import AIRFRAME, Airframe, AngleLimit, airframe_of
from fsw.autopilot.model.arm_coordinates import (
    along_other,
    arm_coordinates,
    first_beyond,
    to_coordinates,
    to_joints,
    within_limits,
)
from fsw.autopilot.model.kinematics import end_effector, level_frame, position
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import JointVector, PredictionState, StateEstimate
from fsw.autopilot.tick_record import ArmTask
from fsw.record import JOINTS
from tests.fsw.autopilot.model.geometry_by_rotation import attitude
from tests.fsw.random_states import estimate_of, vec3
from tests.fsw.records import compensated_joints, joint_reference
from vehicles.vehicle_file import load_vehicle, vehicle_names

VEHICLES = {name: airframe_of(load_vehicle(name)) for name in vehicle_names()}
LIMITS, JOINT_LIMITS, DT = CompensationLimits(), JointReferenceLimits(), 0.002


def with_limits(rows: list[tuple[tuple[float, ...], float, float]], joints: int) -> Airframe:
    """A vehicle with so many joints, as far as limits of angles go."""
    limits = tuple(AngleLimit(*row) for row in rows)
    bodies = replace(AIRFRAME.bodies, joints=joints)
    rates = (5.0,) * JOINTS
    return replace(AIRFRAME, bodies=bodies, angle_limits=limits, joint_rate_max=rates)


# Three joints; one sum ends at each of the last two, and the last has a limit of its own besides.
THREE = with_limits(
    [
        ((1.0, 0.0, 0.0), -1.0, 0.8),
        ((0.0, 0.0, 1.0), -0.7, 0.7),
        ((1.0, 1.0, 0.0), -1.2, 1.4),
        ((0.0, 2.0, 1.0), -1.5, 1.5),
    ],
    3,
)


def planned(random: np.random.Generator, airframe: Airframe) -> PredictionState:
    arm, n = arm_coordinates(airframe), airframe.bodies.joints
    home = np.array(airframe.home_posture[:n]) + random.uniform(-0.15, 0.15, n)
    ax, ay = (float(a) for a in random.uniform(-1.0, 1.0, 2))
    return PredictionState(
        p=vec3(random.uniform(-1.0, 1.0, 3)), v=vec3(random.uniform(-0.3, 0.3, 3)),
        a=(ax, ay, 0.2), j=(0.2, -0.3), s=(0.0, 0.0),
        yaw=float(random.uniform(-math.pi, math.pi)), yaw_rate=0.1,
        q_arm=within_limits(arm, tuple(home.tolist()), 0.2), qd_arm=(0.1,) * n,
    )  # fmt: skip


def seen(plan: PredictionState, off: float, random: np.random.Generator) -> StateEstimate:
    """The vehicle as planned, but for its place, which is ``off`` [m] along each axis."""
    R = attitude(np.array(plan.a), plan.yaw)
    p = vec3(np.array(plan.p) + random.choice([-off, off], 3))
    return estimate_of(R, (0.0, 0.0, 0.1), p, plan.v, q_arm=(0.0, 0.0))


def at(estimate: StateEstimate, q_arm: JointVector) -> StateEstimate:
    return estimate._replace(q_arm=q_arm, qd_arm=(0.0,) * len(q_arm))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", VEHICLES)
def test_the_end_effector_is_moved_to_its_place_as_far_as_joints_can(name: str, seed: int) -> None:
    airframe, random = VEHICLES[name], np.random.default_rng(seed)
    plan = planned(random, airframe)
    estimate = seen(plan, 0.006, random)
    q_arm, _ = compensated_joints(airframe, LIMITS, JOINT_LIMITS, 0.0, estimate, plan)
    b = airframe.bodies
    wanted = np.array(end_effector(b, at(estimate._replace(p_WB=plan.p), plan.q_arm))[0])
    left = np.array(end_effector(b, at(estimate, q_arm))[0]) - wanted
    idle = np.array(end_effector(b, at(estimate, plan.q_arm))[0]) - wanted
    assert np.linalg.norm(idle) > 0.009
    # What is left is across all that any joint moves.
    small = 1e-6
    for k in range(b.joints):
        moved = tuple(q + small * (i == k) for i, q in enumerate(q_arm))
        way = (np.array(end_effector(b, at(estimate, moved))[0]) - wanted - left) / small
        reach = float(np.linalg.norm(way))  # m; with a short one a joint would have to turn far
        if reach > 0.05:
            assert abs(left @ way) < 0.1 * np.linalg.norm(idle) * reach
    assert np.linalg.norm(left) < np.linalg.norm(idle)


FOLDED = (0.3, -0.9, 1.53)  # of hexa-3r: the end-effector 30 mm beside the turntable's axis


def joints_of(airframe: Airframe, q_arm: JointVector) -> list[Array]:
    """Where the joints are [m, B], and the end-effector."""
    b, frame = airframe.bodies, level_frame(airframe.bodies, q_arm, 0.0)
    places = [(k + 1, (0.0, 0.0, 0.0)) for k in range(b.joints)] + [(b.joints, b.tip)]
    return [np.array(position(frame, on, local)) for on, local in places]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", VEHICLES)
def test_no_joint_is_swung_farther_than_the_end_effector_has_to_go(name: str, seed: int) -> None:
    airframe, random = VEHICLES[name], np.random.default_rng(seed)
    plan = planned(random, airframe)
    if name == "hexa-3r":
        plan = plan._replace(q_arm=FOLDED)
    off = 0.01
    estimate = seen(plan, off, random)
    q_arm, _ = compensated_joints(airframe, LIMITS, JOINT_LIMITS, 0.0, estimate, plan)
    before, after = joints_of(airframe, plan.q_arm), joints_of(airframe, q_arm)
    # Each of up to two directions that joints leave to others adds its own.
    most = max(math.dist(a, b) for a, b in zip(before, after, strict=True))
    assert most < 1.2 * math.sqrt(3.0) * off


def test_rates_of_an_arm_that_is_not_swung_are_those_of_its_angles() -> None:
    airframe, random = VEHICLES["hexa-3r"], np.random.default_rng(1)
    plan = planned(random, airframe)._replace(q_arm=FOLDED, j=(0.0, 0.0), yaw_rate=0.0)
    estimate = seen(plan, 0.006, random)._replace(w_WB_B=(0.0, 0.0, 0.0), v_WB=(0.05, 0.0, 0.02))
    _, rates = compensated_joints(airframe, LIMITS, JOINT_LIMITS, 0.0, estimate, plan)
    moment, angles = 1e-5, []
    for t in (-moment, moment):
        ahead = plan._replace(
            p=vec3(np.array(plan.p) + t * np.array(plan.v)),
            q_arm=tuple(q + t * qd for q, qd in zip(plan.q_arm, plan.qd_arm, strict=True)),
        )
        moved = estimate._replace(p_WB=vec3(np.array(estimate.p_WB) + t * np.array(estimate.v_WB)))
        angles.append(
            np.array(compensated_joints(airframe, LIMITS, JOINT_LIMITS, 0.0, moved, ahead)[0])
        )
    expected = (angles[1] - angles[0]) / (2.0 * moment)
    # Left out is how what swings changes with the pose.
    np.testing.assert_allclose(rates, expected, atol=0.1)


def test_coordinates_are_sums_that_end_where_their_limits_do() -> None:
    arm = arm_coordinates(THREE)
    assert arm.row[:3] == (1.0, 0.0, 0.0)
    assert arm.row[JOINTS : JOINTS + 3] == (1.0, 1.0, 0.0)
    assert arm.row[2 * JOINTS : 2 * JOINTS + 3] == (0.0, 2.0, 1.0)
    assert (arm.low[:3], arm.high[:3]) == ((-1.0, -1.2, -1.5), (0.8, 1.4, 1.5))
    assert arm.others == 1
    assert arm.other_row[:3] == (0.0, 0.0, 1.0)
    q, c, back = (0.3, -0.2, 0.5), np.zeros(3), np.zeros(3)
    to_coordinates(arm, q, c)
    to_joints(arm, c, back)
    np.testing.assert_allclose(c, [0.3, 0.1, 0.1])
    np.testing.assert_allclose(back, q)
    assert along_other(arm, 0, q) == 0.5


def test_a_joint_without_a_limit_is_its_own_coordinate() -> None:
    arm = arm_coordinates(with_limits([((1.0, 0.0), -1.0, 1.0)], 2))
    assert (arm.low[1], arm.high[1]) == (-math.inf, math.inf)
    assert arm.row[JOINTS : JOINTS + 2] == (0.0, 1.0)
    assert within_limits(arm, (2.0, 50.0), 0.1) == (0.9, 50.0)


@pytest.mark.drawn(5)
@pytest.mark.parametrize("seed", range(20))
def test_references_keep_every_limit_in_angle_and_rate(seed: int) -> None:
    random, arm = np.random.default_rng(seed), arm_coordinates(THREE)
    now: tuple[JointVector, JointVector] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for _ in range(12):
        wish = tuple(random.uniform(-2.0, 2.0, 3).tolist())
        rates = tuple(random.uniform(-3.0, 3.0, 3).tolist())
        for _ in range(60):
            now = joint_reference(THREE, JOINT_LIMITS, now, (wish, rates), DT)
            assert first_beyond(THREE.angle_limits, now[0], -JOINT_LIMITS.margin + 2e-3) is None
            assert max(map(abs, now[1])) <= JOINT_LIMITS.rate + 1e-9
    assert arm.others == 1


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_joint_at_a_limit_beside_its_coordinate_is_not_accelerated_beyond(side: float) -> None:
    arm = arm_coordinates(THREE)
    q, qdd = np.array([0.0, 0.0, side * 0.7]), np.array([0.0, 0.0, side * 50.0])
    limit_acceleration(THREE, arm, ArmTask(), q, np.zeros(3), qdd)
    assert qdd[2] * side <= 1e-9


def test_who_is_beyond_is_named_with_its_limit() -> None:
    limits = THREE.angle_limits
    assert first_beyond(limits, (0.0, 0.0, 0.0), 0.0) is None
    assert first_beyond(limits, (0.9, 0.0, 0.0), 0.0) == "joint 1 at 52 deg is beyond its limit"
    assert first_beyond(limits, (0.7, 0.8, 0.0), 0.0) == (
        "joints 1 and 2 together at 86 deg are beyond their limit"
    )
    assert first_beyond(limits, (0.9, 0.0, 0.0), 0.2) is None
