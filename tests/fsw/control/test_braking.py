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

from fsw.barriers.safe_approach import safe_approach_speed
from fsw.control.braking import Brake, BrakeTuning
from fsw.model.airframe import AIRFRAME, GRAVITY, AttitudeLag
from fsw.model.nominal import NominalModel
from fsw.mpc.planner_config import PlannerConfig
from fsw.mpc.qp_data import InputLimits
from fsw.signals import PlanInput, PredictionState, Vec3

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
    for length, angle in zip(AIRFRAME.link_length, angles, strict=True):
        tips.append(tips[-1] + length * (math.sin(angle) * ahead + math.cos(angle) * down))
    return np.array(tips)


def nearest_wall(x: PredictionState, normal: Array) -> float:
    """Offset of the nearest plane from which every point still has h >= lambda [m]."""
    after = MODEL.step(x, PlanInput(x.a, 0.0, (0.0, 0.0)))
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


@pytest.mark.parametrize("seed", range(8))
def test_whoever_keeps_lambda_stops_before_the_wall(seed: int) -> None:
    dice = random.Random(seed)
    for _ in range(8):
        x, normal = random_state(dice)
        offset = nearest_wall(x, normal)
        begin, closest = x, math.inf
        for k in range(1000):
            x = MODEL.step(x, BRAKE(x))
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
        x = MODEL.step(x, u)
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
