"""Braking brings any plan state to rest, gently enough to be followed, and before the wall.

Before the wall means: from a state that keeps the robust barrier, h >= lambda, at every point of
the vehicle, both with the velocity it has and with the one it will have when the tilt of now has
been taken back (0.3 s of the present acceleration). An acceleration at the wall that h does not
see would carry any law through it.
"""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov

from fsw.autopilot.barriers.safe_approach import safe_approach_speed
from fsw.autopilot.control.braking import Brake, BrakeTuning
from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY, AttitudeLag
from fsw.autopilot.model.nominal import NominalModel
from fsw.autopilot.model.prediction import A, J, S, V, continuous_model
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.qp_data import InputLimits
from fsw.autopilot.signals import PlanInput, PredictionState, Vec2, Vec3
from tests.fsw.paper_arm import LENGTHS
from tests.paper_vehicle import YAW_PER_THRUST

DT = 0.002
MODEL = NominalModel(AIRFRAME, DT)
BRAKE = Brake(AIRFRAME, InputLimits().tilt)
WALLS = PlannerConfig().walls
TAKEN_BACK_S = 0.3  # by when the tilt of now no longer accelerates
STILL: Vec3 = (0.0, 0.0, 0.0)

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


def state(
    v: Vec3 = STILL, a: Vec3 = STILL, yaw: float = 0.0, yaw_rate: float = 0.0,
    q_arm: tuple[float, float] = (0.0, 0.0), qd_arm: tuple[float, float] = (0.0, 0.0),
) -> PredictionState:  # fmt: skip
    return PredictionState(STILL, v, a, (0.0, 0.0), (0.0, 0.0), yaw, yaw_rate, q_arm, qd_arm)


def points(x: PredictionState) -> Array:
    """Base, joint 2 and end-effector (3, 3) [m] of a body tilted for the state's acceleration."""
    down = np.array([-x.a[0], -x.a[1], GRAVITY - x.a[2]])
    down /= np.linalg.norm(down)
    right = np.cross(down, [math.cos(x.yaw), math.sin(x.yaw), 0.0])
    right /= np.linalg.norm(right)
    ahead = np.cross(right, down)
    angles, tips = (x.q_arm[0], sum(x.q_arm)), [np.array(x.p)]
    for length, angle in zip(LENGTHS, angles, strict=True):
        tips.append(tips[-1] + length * (math.sin(angle) * ahead + math.cos(angle) * down))
    return np.array(tips)


def nearest_wall(x: PredictionState, normal: Array) -> float:
    """Offset of the nearest plane from which every point still has h >= lambda [m]."""
    after = MODEL.advance(x, PlanInput(x.a, 0.0, (0.0, 0.0)))
    velocity = (points(after) - points(x)) / DT
    later = velocity + TAKEN_BACK_S * np.array(x.a)
    offset = math.inf
    for point, now, then in zip(points(x), velocity, later, strict=True):
        needed = WALLS.lambda_ - min(normal @ now, normal @ then)
        offset = min(offset, float(normal @ point) - distance_for(needed))
    return offset


def distance_for(speed: float) -> float:
    """The inverse of S(d) for a distance of zero or more [m]."""
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (
            (low, middle)
            if safe_approach_speed(middle, WALLS.alpha, WALLS.slope) > speed
            else (middle, high)
        )
    return high


def random_state(dice: random.Random) -> tuple[PredictionState, Array]:
    """A state of up to 1 m/s and 2 m/s^2 anywhere around, and the normal of a wall."""
    around = [dice.uniform(-math.pi, math.pi) for _ in range(4)]
    speed, tilting = dice.uniform(0.0, 1.0), dice.uniform(0.0, 2.0)
    x = state(
        (speed * math.cos(around[0]), speed * math.sin(around[0]), dice.uniform(-0.3, 0.3)),
        (tilting * math.cos(around[1]), tilting * math.sin(around[1]), 0.0),
        around[2],
        0.0,
        (dice.uniform(-1.0, 1.0), dice.uniform(-1.0, 1.0)),
        (dice.uniform(-1.0, 1.0), dice.uniform(-1.0, 1.0)),
    )
    return x, np.array([math.cos(around[3]), math.sin(around[3]), 0.0])


@pytest.mark.drawn(4)
@pytest.mark.requirement("REQ-PLAN-5")
@pytest.mark.parametrize("seed", range(8))
def test_whoever_keeps_lambda_stops_before_the_wall(seed: int) -> None:
    dice = random.Random(seed)
    for _ in range(8):
        x, normal = random_state(dice)
        offset = nearest_wall(x, normal)
        begin, closest = x, math.inf
        for k in range(1000):
            x = MODEL.advance(x, BRAKE(x))
            if k % 10 == 9:
                closest = min(closest, float((points(x) @ normal).min()) - offset)
        assert closest >= 0.0, begin
        assert math.dist(x.v, STILL) < 1e-3
        assert math.dist(x.qd_arm, (0.0, 0.0)) < 1e-3


@settings(max_examples=30, deadline=None)
@given(
    st.tuples(*[st.floats(-2.0, 2.0)] * 3),
    st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.just(0.0)),
    st.floats(math.radians(2.0), math.radians(30.0)),
)
def test_braking_is_within_the_plans_tilt(v: Vec3, a: Vec3, tilt: float) -> None:
    u = Brake(AIRFRAME, tilt)(state(v, a))
    assert math.hypot(u.a[0], u.a[1]) <= math.tan(tilt) * (GRAVITY - u.a[2]) + 1e-9


@settings(max_examples=30, deadline=None)
@given(
    st.tuples(*[st.floats(-2.0, 2.0)] * 3),
    st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.just(0.0)),
)
def test_braking_is_within_tilt_and_jerk_and_does_not_swing_back(v: Vec3, a: Vec3) -> None:
    x, tilt = state(v, a), math.tan(InputLimits().tilt)
    for _ in range(2000):
        u = BRAKE(x)
        assert math.hypot(u.a[0], u.a[1]) <= tilt * (GRAVITY - u.a[2]) + 1e-9
        assert abs(u.a[2]) <= BrakeTuning().vertical
        x = MODEL.advance(x, u)
        assert math.hypot(*x.j) < 25.0  # m/s^3
    assert math.dist(x.v, STILL) < 1e-2
    assert math.hypot(x.a[0], x.a[1]) < 1e-2


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("axis", range(3))
def test_braking_opposes_every_motion(axis: int, sign: float) -> None:
    v = [0.0, 0.0, 0.0]
    v[axis] = sign
    u = BRAKE(state((v[0], v[1], v[2]), yaw_rate=sign, qd_arm=(sign, -sign)))
    assert sign * u.a[axis] < -1.5
    assert sign * u.yaw_acc < 0.0
    assert sign * u.qdd_arm[0] < 0.0 < sign * u.qdd_arm[1]


def test_a_tilt_into_the_motion_is_braked_harder_than_one_against_it() -> None:
    into, against = (
        state((0.2, 0.0, 0.0), (1.0, 0.0, 0.0)),
        state((0.2, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    )
    assert BRAKE(into).a[0] < BRAKE(against).a[0] - 2.0


def test_at_rest_nothing_is_asked_for() -> None:
    assert BRAKE(state()) == PlanInput((0.0, 0.0, 0.0), 0.0, (0.0, 0.0))


def test_the_paper_s_model_is_braked_without_a_lag() -> None:
    u = Brake(replace(AIRFRAME, attitude_lag=AttitudeLag(at_once=True)), InputLimits().tilt)(
        state((0.1, 0.0, 0.0), (5.0, 0.0, 0.0))
    )
    assert -2.0 < u.a[0] < -0.5


LEVEL_SPEEDS = st.tuples(*[st.floats(-0.05, 0.05)] * 2)
# Gentle enough to stay within the tilt.
LINEAR = Brake(AIRFRAME, 0.3, BrakeTuning(input_weight=1.0))


def linear_state(v: Vec2, a: Vec2, j: Vec2, s: Vec2) -> PredictionState:
    return state((*v, 0.0), (*a, 0.0))._replace(j=j, s=s)


@settings(max_examples=50, deadline=None)
@given(LEVEL_SPEEDS, LEVEL_SPEEDS, LEVEL_SPEEDS, LEVEL_SPEEDS, st.floats(-math.pi, math.pi))
def test_a_turned_state_is_braked_by_the_turned_input(
    v: Vec2, a: Vec2, j: Vec2, s: Vec2, angle: float
) -> None:
    """No direction is special: velocity, acceleration, jerk and snap of an axis belong together."""

    def turned(x: Vec2) -> Vec2:
        c, sn = math.cos(angle), math.sin(angle)
        return c * x[0] - sn * x[1], sn * x[0] + c * x[1]

    straight = LINEAR(linear_state(v, a, j, s)).a
    around = LINEAR(linear_state(turned(v), turned(a), turned(j), turned(s))).a
    assert around[:2] == pytest.approx(turned((straight[0], straight[1])), abs=1e-12)


@pytest.mark.parametrize("part", ["v", "a", "j", "s"])
def test_braking_costs_least_of_all_feedbacks_of_the_planned_axis(part: str) -> None:
    """Linear quadratic: another gain on any part of the state, a little more or less, costs more.

    The cost is the integral of v^2 + price u^2 from a unit of each part, by the Lyapunov equation
    of the axis that the prediction model integrates: v' = a, a' = j, j' = s, s' = kp (u - a) - ...
    """
    input_weight = BrakeTuning().input_weight
    a_model, b_model = continuous_model(AIRFRAME)
    axis = [V, A, J, S]
    a_axis, b_axis = a_model[np.ix_(axis, axis)], b_model[axis, :1]
    brake, small = Brake(AIRFRAME, 1.5), 1e-4
    units = [linear_state(*[(small * (k == i), 0.0) for i in range(4)]) for k in range(4)]
    gains = np.array([[-brake(x).a[0] / small for x in units]])

    def cost(k: Array) -> float:
        closed = a_axis - b_axis @ k
        price = np.diag([1.0, 0.0, 0.0, 0.0]) + input_weight * k.T @ k
        return float(np.trace(solve_continuous_lyapunov(closed.T, -price)))

    index = ["v", "a", "j", "s"].index(part)
    for factor in (0.97, 1.03):
        other = gains.copy()
        other[0, index] *= factor
        assert cost(other) > cost(gains)


def test_without_a_lag_only_the_velocity_is_fed_back_with_one_over_the_root_of_the_price() -> None:
    brake = Brake(replace(AIRFRAME, attitude_lag=AttitudeLag(at_once=True)), 0.3)
    moving = linear_state((0.05, -0.04), (3.0, 2.0), (5.0, -4.0), (9.0, 8.0))
    gain = 1.0 / math.sqrt(BrakeTuning().input_weight)
    assert brake(moving).a == pytest.approx((-0.05 * gain, 0.04 * gain, 0.0))


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.05, 0.05))
def test_slow_vertical_joint_and_yaw_motions_decay_at_their_own_rates(
    sink: float, first: float, second: float, turning: float
) -> None:
    tuning = BrakeTuning(vertical_rate=3.0, joint_rate=7.0)
    x = state((0.0, 0.0, sink), yaw_rate=turning, qd_arm=(first, second))
    u = Brake(AIRFRAME, 0.3, tuning)(x)
    assert u.a[2] == pytest.approx(-3.0 * sink)
    assert u.qdd_arm == pytest.approx((-7.0 * first, -7.0 * second))
    assert u.yaw_acc == pytest.approx(-turning)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_fast_ones_are_braked_by_what_the_tuning_allows(sign: float) -> None:
    x = state((0.0, 0.0, 9.0 * sign), yaw_rate=9.0 * sign, qd_arm=(9.0 * sign, -9.0 * sign))
    u, tuning = BRAKE(x), BrakeTuning()
    assert u.a[2] == -sign * tuning.vertical
    assert u.qdd_arm == (-sign * tuning.joint, sign * tuning.joint)
    assert u.yaw_acc == -sign * tuning.yaw
    # What drag of the rotors gives at most: that of the hover thrust, over inertia.
    drag = YAW_PER_THRUST * AIRFRAME.mass * GRAVITY / AIRFRAME.bodies.base_inertia[2]
    assert tuning.yaw < drag


def test_a_hard_brake_uses_the_whole_tilt_and_keeps_its_direction() -> None:
    u = BRAKE(state((1.5, -2.0, 0.5)))
    tilt = math.tan(InputLimits().tilt)
    assert u.a[2] < 0.0
    assert math.hypot(u.a[0], u.a[1]) == pytest.approx(tilt * GRAVITY)
    assert math.atan2(u.a[1], u.a[0]) == pytest.approx(math.atan2(2.0, -1.5))
    sinking = BRAKE(state((1.5, -2.0, -0.5)))
    assert math.hypot(*sinking.a[:2]) == pytest.approx(tilt * (GRAVITY - sinking.a[2]))
