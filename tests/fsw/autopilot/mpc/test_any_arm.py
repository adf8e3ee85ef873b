"""The planner of vehicles with other arms: what a plan promises, it promises for every one."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.barriers.zone_rows import ZoneRows
from fsw.autopilot.model.airframe import Airframe, airframe_of
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.kinematics import end_effector_when_level, predicted_end_effector
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.nominal import rest_state
from fsw.autopilot.model.prediction import (
    Q_ARM,
    QD_ARM,
    Array,
    CondensedModel,
    condense,
    to_vector,
)
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import PlanRequest, PredictionState, SafeSet, Vec3
from tests.fsw.autopilot.mpc.requests import PERIOD_US, planned
from tests.fsw.random_states import prediction_vector
from tests.vehicles.random_vehicles import random_vehicle
from vehicles.vehicle_file import load_vehicle

CONFIG = PlannerConfig()
NODES = CONFIG.horizon
VEHICLES = ("paper", "x500-2r", "hexa-3r", "octo-4r")


@cache
def of(name: str) -> tuple[Airframe, CondensedModel, Planner]:
    """A packaged vehicle, or one that is made up with as many joints as its name says."""
    vehicle = (
        random_vehicle(np.random.default_rng(int(name)), int(name))
        if name.isdigit()
        else load_vehicle(name)
    )
    airframe = airframe_of(vehicle)
    planner = Planner(CONFIG, airframe, stopwatch_us=lambda: 0.0)
    return airframe, condense(airframe, CONFIG.period, NODES), planner


def hovering(airframe: Airframe, q_arm: tuple[float, ...]) -> PredictionState:
    state = rest_state(airframe.bodies.joints)
    return state._replace(p=(0.0, 0.0, -1.2), q_arm=q_arm)


def as_state(x: Array) -> PredictionState:
    p, v, a, j, s = (tuple(x[at].tolist()) for at in np.split(np.arange(13), [3, 6, 9, 11]))
    arm = tuple(x[Q_ARM::2].tolist()), tuple(x[QD_ARM::2].tolist())
    return PredictionState(p, v, a, j, s, float(x[13]), float(x[14]), *arm)


def flown(
    name: str,
    start: PredictionState,
    target: tuple[float, float, float],
    zones: SafeSet,
    cycles: int,
) -> Array:
    """The states at the cycles (cycles + 1, states) of a vehicle that does what is planned."""
    _, model, planner = of(name)
    x = [to_vector(start)]
    for k in range(cycles):
        targets = (still_at(target),) * (NODES + 1)
        asked = PlanRequest(k, k * PERIOD_US, as_state(x[-1]), targets, zones, k > 0)
        plan = planned(planner.plan(asked))
        u = np.array([(*one.a, one.yaw_acc, *one.qdd_arm) for one in plan.inputs]).ravel()
        x.append((model.phi @ x[-1] + model.gamma @ u)[1])
    return np.array(x)


@pytest.mark.parametrize("name", VEHICLES)
def test_it_brings_the_end_effector_to_its_target_with_the_arm_within_its_limits(
    name: str,
) -> None:
    airframe, _, _ = of(name)
    joints = airframe.bodies.joints
    home = airframe.home_posture[:joints]
    x, y, z = end_effector_when_level(airframe.bodies, home, 0.0)
    target = (0.5 + x, -0.3 + y, -1.4 + z)
    states = flown(name, hovering(airframe, home), target, SafeSet(), 80)
    tip, v = predicted_end_effector(airframe.bodies, states[-1])
    np.testing.assert_allclose(tip, target, atol=5e-3)
    np.testing.assert_allclose(v, 0.0, atol=5e-3)
    q, qd = states[:, Q_ARM::2], states[:, QD_ARM::2]
    for limit in airframe.angle_limits:
        angle = q @ limit.row
        assert limit.low <= angle.min() <= angle.max() <= limit.high
    assert (np.abs(qd) <= np.array(airframe.joint_rate_max[:joints])).all()


@pytest.mark.parametrize("name", ["hexa-3r", "octo-4r"])
def test_joints_that_nothing_asks_for_come_home(name: str) -> None:
    """From a posture that reaches the same place: without a pull to it, they would stay there."""
    airframe, _, _ = of(name)
    home = np.array(airframe.home_posture[: airframe.bodies.joints])
    away = home.copy()
    away[0] += 0.4
    x, y, z = end_effector_when_level(airframe.bodies, tuple(away.tolist()), 0.0)
    start = hovering(airframe, tuple(away.tolist()))
    states = flown(name, start, (x, y, z - 1.2), SafeSet(), 300)
    # Not to the last tenth of a radian: the pull is weak, and the arm's centre of mass counts too.
    np.testing.assert_allclose(states[-1, Q_ARM::2], home, atol=0.15)
    np.testing.assert_allclose(states[-1, QD_ARM::2], 0.0, atol=0.01)
    tip, _ = predicted_end_effector(airframe.bodies, states[-1])
    np.testing.assert_allclose(tip, (x, y, z - 1.2), atol=5e-3)


@pytest.mark.drawn(2)
@pytest.mark.parametrize("name", VEHICLES)
def test_no_part_of_it_comes_closer_to_a_wall_than_its_barrier_lets_it(name: str) -> None:
    airframe, model, _ = of(name)
    joints = airframe.bodies.joints
    home = airframe.home_posture[:joints]
    x, y, z = end_effector_when_level(airframe.bodies, home, 0.0)
    ahead = SafeSet((wall((-1.0, 0.0, 0.0), -0.9, 0.1),))
    target = (1.3 + x, y, z - 1.2)  # beyond the wall
    states = flown(name, hovering(airframe, home), target, ahead, 60)
    rows = ZoneRows(ahead, body_of("full", airframe), model, CONFIG.tunings, distances=True)
    margins = []
    for state in states:
        horizon = Linearisation(model)
        horizon.refill(state, np.zeros(model.inputs * NODES))
        rows.refill(horizon, targets_of(target))
        margins.append(rows.rows.start.min())
    assert min(margins) > 0.0
    assert margins[-1] < 0.12, "it went as far as it may"


def targets_of(target: Vec3) -> TargetPoints:
    return TargetPoints(
        np.tile(target, (NODES + 1, 1)), np.zeros((NODES + 1, 3)), np.zeros(NODES + 1)
    )


@pytest.mark.drawn(5)
@pytest.mark.parametrize("name", [*VEHICLES, *"123456"])
def test_no_row_is_left_out_that_inputs_within_their_limits_could_make_bind(name: str) -> None:
    """Against all rows; near and far, moving, with inputs at their corners."""
    airframe, model, _ = of(name)
    body, joints = body_of("full", airframe), airframe.bodies.joints
    random = np.random.default_rng(1)
    level, vertical, yaw, joint = CONFIG.limits.most
    most = np.tile([level, level, vertical, yaw, *[joint] * joints], NODES)
    some = 0
    for far in np.geomspace(1.0, 1000.0, 10):
        zones = SafeSet(
            (wall((1.0, 0.0, 0.0), -float(far), 0.1), point((0.0, float(far), -1.2), 0.2))
        )
        start = prediction_vector(random, joints)
        start[:3], start[11:13] = (0.0, 0.0, -1.2), 0.0
        horizon = Linearisation(model)
        horizon.refill(start, 0.3 * most * random.uniform(-1.0, 1.0, len(most)))
        rows = ZoneRows(zones, body, model, CONFIG.tunings, most=CONFIG.limits.most)
        whole = ZoneRows(zones, body, model, CONFIG.tunings)
        for one in (rows, whole):
            one.refill(horizon, targets_of((0.0, 0.0, -1.2)))
        inputs = random.choice([-1.0, 1.0], (300, len(most))) * most - horizon.horizon.inputs
        left_out = ~rows.rows.gradient.any(axis=1) & whole.rows.gradient.any(axis=1)
        some += int(left_out.sum())
        reached = whole.rows.value + inputs @ whole.rows.gradient.T - whole.rows.lower_bound
        assert (reached[:, left_out] > 0.0).all()
    assert some > 0


def test_a_joint_that_turns_slowly_is_planned_slowly() -> None:
    airframe, _, _ = of("hexa-3r")
    home = airframe.home_posture[:3]
    start = hovering(airframe, home)._replace(qd_arm=(0.0, 0.0, 0.0))
    x, y, z = end_effector_when_level(airframe.bodies, (2.0, *home[1:]), 0.0)
    states = flown("hexa-3r", start, (x, y, z - 1.2), SafeSet(), 20)
    assert math.isclose(airframe.joint_rate_max[0], 4.0)
    assert np.abs(states[:, QD_ARM]).max() <= 0.6 * 4.0 + 1e-3
