"""The loop that follows the plan: feed-forward, signs, limits, observer."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.gains import TrackingTuning, tracking_gains
from fsw.autopilot.control.tracking import (
    AxisState,
    TrackingLaw,
    follow_plan,
    snap_command,
    velocity_of_mass,
)
from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY, AttitudeLag
from fsw.autopilot.model.rotors import MotionState
from fsw.autopilot.signals import PlanInput, PredictionState, StateEstimate, Vec3
from fsw.autopilot.tick_record import Observed, new_tick
from tests.fsw.random_states import estimate_of, vec3
from tests.fsw.records import changed, observe, observed

LAG = AttitudeLag()
TUNING = TrackingTuning()
LAW = TrackingLaw(LAG, TUNING, tracking_gains(TUNING, AIRFRAME.rotor_lag, 0.002))
BRISK = replace(TUNING, observer_bandwidth=100.0)
WEIGHT = AIRFRAME.mass * GRAVITY
CALM: Vec3 = (0.0, 0.0, 0.0)
NOTHING = observed(CALM, CALM)
REST = AxisState(0.0, 0.0, 0.0, 0.0, 0.0)


def calm(estimate: StateEstimate) -> Observed:
    """No disturbance, and the velocity as it is."""
    return observed(estimate.v_WB, CALM)


REST_INPUT = PlanInput(CALM, 0.0, (0.0, 0.0))
PLAN = PredictionState(
    (0.0, 0.0, -1.0), CALM, CALM, (0.0, 0.0), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0), (0.0, 0.0)
)

NO_SWING = (0.0,) * 9


def on_plan(rotation: Rotation, plan: PredictionState) -> tuple[StateEstimate, MotionState]:
    """A vehicle that is exactly where the plan wants it."""
    estimate = estimate_of(rotation, p_WB=plan.p, v_WB=plan.v)
    return estimate, MotionState(WEIGHT, plan.a, plan.j, plan.s)


def snap_of(estimate: StateEstimate, wd: tuple[float, float]) -> np.ndarray:
    """Horizontal snap that angular accelerations about body x and y make at hover thrust."""
    turn = np.reshape(estimate.R_WB, (3, 3))
    b3_second = np.cross(turn @ np.array([wd[0], wd[1], 0.0]), turn[:, 2])
    return np.asarray(-GRAVITY * b3_second[:2])


@pytest.mark.parametrize("yaw", [0.0, 1.0, math.pi, -2.0])
@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_without_error_the_plans_own_snap_is_flown(yaw: float, tilt: float) -> None:
    rotation = Rotation.from_euler("ZYX", [yaw, tilt, -tilt])
    plan = PLAN._replace(a=(0.5, -0.8, 0.2), j=(1.0, -2.0), s=(10.0, 20.0))
    u = PlanInput((1.0, -1.0, 0.3), 0.0, (0.0, 0.0))
    estimate, motion = on_plan(rotation, plan)
    wd, thrust = follow_plan(
        LAW, AIRFRAME.mass, NO_SWING, estimate, motion, calm(estimate), plan, u
    )
    expected = [LAG.kp * (u.a[k] - plan.a[k]) - LAG.kd * plan.j[k] for k in (0, 1)]
    np.testing.assert_allclose(snap_of(estimate, wd), expected, atol=1e-9)
    upright = estimate.R_WB[8]
    assert thrust * upright == pytest.approx(AIRFRAME.mass * (GRAVITY - u.a[2]))


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2.0, math.pi, -math.pi / 2.0])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("quantity", ["p", "v", "a", "j", "s"])
def test_the_vehicle_is_snapped_towards_the_plan(yaw: float, axis: int, quantity: str) -> None:
    """Each error by itself, at every heading: the snap points the error's way."""
    size = {"p": 0.01, "v": 0.05, "a": 0.1, "j": 0.5, "s": 20.0}[quantity]
    error = [0.0] * len(getattr(PLAN, quantity))
    error[axis] = size
    start = getattr(PLAN, quantity)
    changed: dict[str, Any] = {quantity: tuple(a + b for a, b in zip(start, error, strict=True))}
    ahead = PLAN._replace(**changed)
    estimate, motion = on_plan(Rotation.from_euler("Z", yaw), PLAN)
    # The plan's own feed-forward depends on a and j; u follows so that it stays the same.
    u = PlanInput(
        (ahead.a[0] + LAG.kd / LAG.kp * ahead.j[0], ahead.a[1] + LAG.kd / LAG.kp * ahead.j[1], 0.0),
        0.0,
        (0.0, 0.0),
    )
    wd, _ = follow_plan(LAW, AIRFRAME.mass, NO_SWING, estimate, motion, calm(estimate), ahead, u)
    snap = snap_of(estimate, wd)
    assert snap[axis] > 1.0
    assert abs(snap[1 - axis]) < 1e-9


def test_a_disturbance_is_leaned_against() -> None:
    estimate, motion = on_plan(Rotation.identity(), PLAN)
    wd, _ = follow_plan(
        LAW,
        AIRFRAME.mass,
        NO_SWING,
        estimate,
        motion,
        observed(estimate.v_WB, (0.5, 0.0, 0.0)),
        PLAN,
        REST_INPUT,
    )
    assert snap_of(estimate, wd)[0] < -1.0
    assert wd[1] > 0.0  # nose up: thrust leans back


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_wind_is_cancelled_whole_once_it_is_believed(sign: float) -> None:
    """On the plan, in wind, the acceleration that is asked for is the opposite of the wind's."""
    wind = sign * TUNING.wind_limit
    k3 = LAW.gains.k[2]
    asked = snap_command(LAW, AxisState(0.0, 0.0, 0.0, 0.0, 0.0), wind, wind, REST, 0.0)
    assert asked == pytest.approx(-k3 * wind)
    leaning = snap_command(LAW, AxisState(0.0, 0.0, -wind, 0.0, 0.0), wind, wind, REST, 0.0)
    assert leaning == pytest.approx(0.0, abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_lasting_push_is_taken_for_wind_up_to_its_limit_and_forgotten(sign: float) -> None:
    """Half of what has not been believed yet within ln 2 time constants, never past the limit."""
    dt, d = 0.002, sign * 0.8 * TUNING.wind_limit
    believed = observed(CALM, (d, 0.0, 0.0))
    for _ in range(round(math.log(2.0) * TUNING.wind_time / dt)):
        believed = observe(changed(believed, v=CALM), (dt * d, 0.0, 0.0), CALM, TUNING, dt)
    assert believed.disturbance_bias.tolist() == pytest.approx([0.5 * d, 0.0], abs=0.01 * abs(d))
    pushed = changed(believed, d=(5.0 * sign, 0.0, 0.0))
    for _ in range(1000):
        pushed = observe(changed(pushed, v=CALM), (dt * 5.0 * sign, 0.0, 0.0), CALM, TUNING, dt)
        assert abs(pushed.disturbance_bias[0]) <= TUNING.wind_limit
    assert pushed.disturbance_bias[0] == pytest.approx(sign * TUNING.wind_limit)
    calm_again = changed(believed, d=CALM)
    for _ in range(round(10.0 * TUNING.wind_time / dt)):
        calm_again = observe(changed(calm_again, v=CALM), CALM, CALM, TUNING, dt)
    assert calm_again.disturbance_bias.tolist() == pytest.approx(
        [0.0, 0.0], abs=1e-3 * TUNING.wind_limit
    )


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_height_errors_change_thrust_the_right_way(sign: float) -> None:
    """Plan below the vehicle (z down): less thrust; above: more."""
    estimate, motion = on_plan(Rotation.identity(), PLAN)
    for plan in (
        PLAN._replace(p=(0.0, 0.0, -1.0 + sign * 0.02)),
        PLAN._replace(v=(0.0, 0.0, sign * 0.1)),
        PLAN._replace(a=(0.0, 0.0, sign * 0.5)),
    ):
        _, thrust = follow_plan(
            LAW, AIRFRAME.mass, NO_SWING, estimate, motion, calm(estimate), plan, REST_INPUT
        )
        assert sign * (thrust - WEIGHT) < -0.2


errors = st.floats(-1e3, 1e3)


@given(errors, errors, st.floats(-10.0, 10.0))
def test_far_from_the_plan_acceleration_and_jerk_wishes_are_limited(
    e_p: float, e_v: float, d: float
) -> None:
    """At the vehicle's own a = j = 0 the command is K4 times a jerk of at most its limit."""
    wanted = snap_command(LAW, AxisState(-e_p, -e_v, 0.0, 0.0, 0.0), d, 0.0, REST, 0.0)
    k4 = LAW.gains.k[3]
    assert abs(wanted) <= k4 * TUNING.jerk_limit + 1e-9
    stoppable = math.sqrt(2.0 * TUNING.stopping_snap * (TUNING.acceleration_limit + 0.15))
    assert abs(wanted) <= k4 * stoppable + 1e-9


@given(errors)
def test_a_vehicle_at_the_acceleration_limit_is_not_asked_for_more(e_p: float) -> None:
    side = math.copysign(1.0, e_p)
    at_limit = side * TUNING.acceleration_limit
    assert (
        side * snap_command(LAW, AxisState(-e_p, 0.0, at_limit, 0.0, 0.0), 0.0, 0.0, REST, 0.0)
        <= 1e-9
    )


def test_that_a_force_is_lost_takes_nothing_from_the_jerk_that_may_be_asked_for() -> None:
    law = replace(LAW, tuning=replace(TUNING, stopping_snap=1e6))
    leaning = AxisState(-1.0, 0.0, -3.0, 0.0, 0.0)

    def asked(push: float) -> float:
        return snap_command(law, leaning, 0.0, 0.0, REST, 0.0, 0.0, push)

    k3, k4 = LAW.gains.k[2], LAW.gains.k[3]
    assert asked(0.0) == pytest.approx(k4 * TUNING.jerk_limit)
    for push in (-0.5, 0.5):
        assert asked(push) == pytest.approx(k4 * TUNING.jerk_limit + k3 * 0.5)


@pytest.mark.parametrize("known", [-1.5, 0.0, 1.5])
@pytest.mark.parametrize("e_p", [-1.0, 1.0])
def test_what_a_surface_carries_lets_the_vehicle_lean_no_farther(known: float, e_p: float) -> None:
    """At the largest lean that is allowed without it, no more is asked for."""
    law = replace(LAW, tuning=replace(TUNING, position_error_limit=10.0))
    most = TUNING.acceleration_limit
    leaning = AxisState(-10.0 * e_p, 0.0, e_p * most, 0.0, 0.0)
    asked = snap_command(law, leaning, 0.0, known, REST, 0.0, known, known)
    assert asked * e_p <= 1e-9


def test_beyond_the_position_limit_more_error_asks_for_nothing_more() -> None:
    def at(error: float) -> float:
        return snap_command(LAW, AxisState(-error, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, REST, 0.0)

    assert at(TUNING.position_error_limit) == at(10.0)


@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_observer_finds_a_constant_disturbance(d: Vec3) -> None:
    dt, v, a = 0.002, np.zeros(3), np.array([0.3, -0.2, 0.1])
    believed = NOTHING
    for _ in range(100):
        v = v + dt * (a + np.array(d))
        believed = observe(believed, vec3(v), vec3(a), BRISK, dt)
    np.testing.assert_allclose(believed.d, d, atol=0.01)
    np.testing.assert_allclose(believed.v, v, atol=1e-3)


def test_observer_passes_little_of_a_velocity_reading_s_noise_on() -> None:
    """Differencing the reading, at the same bandwidth, would carry bandwidth x noise: 1 m/s^2."""
    rng = np.random.default_rng(3)
    believed, found = NOTHING, []
    for _ in range(5000):
        believed = observe(believed, vec3(rng.normal(0.0, 0.01, 3)), (0.0, 0.0, 0.0), BRISK, 0.002)
        found.append(believed.d)
    assert np.std(np.array(found)) < 0.4


def test_tracking_gains_stabilise_the_chain_they_are_designed_for() -> None:
    """The sampled loop of both chains, closed, has every pole inside the unit circle."""
    dt, lag = 0.002, AIRFRAME.rotor_lag
    steps = 10_000
    p, v, a, j, s = 0.05, 0.0, 0.0, 0.0, 0.0
    for _ in range(steps):
        w = -float(np.dot(LAW.gains.k, (p, v, a, j, s)))
        p, v, a, j = p + dt * v, v + dt * a, a + dt * j, j + dt * s
        s += dt * (w - s) / lag
    assert abs(p) < 1e-6
    z, v, a = 0.05, 0.0, 0.0
    for _ in range(steps):
        u = -float(np.dot(LAW.gains.k_vertical, (z, v, a)))
        z, v = z + dt * v, v + dt * a
        a += dt * (u - a) / lag
    assert abs(z) < 1e-6


@given(st.tuples(*[st.floats(-50.0, 50.0)] * 3), st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_only_differences_of_place_and_velocity_count(there: Vec3, moving: Vec3) -> None:
    """The same vehicle and plan somewhere else, or seen from a moving train."""

    def moved(p: Vec3, by: Vec3) -> Vec3:
        return p[0] + by[0], p[1] + by[1], p[2] + by[2]

    swing = (0.0, 0.01, 0.0, -0.01, *(0.0,) * 5)
    ahead = PLAN._replace(p=(0.02, -0.01, -1.01), v=(0.05, 0.04, -0.02))
    estimate, motion = on_plan(Rotation.from_euler("ZYX", [0.7, 0.1, -0.2]), PLAN)
    here = follow_plan(LAW, 3.5, swing, estimate, motion, calm(estimate), ahead, REST_INPUT)
    estimate = estimate._replace(p_WB=moved(estimate.p_WB, there), v_WB=moving)
    ahead = ahead._replace(p=moved(ahead.p, there), v=moved(ahead.v, moving))
    same = follow_plan(LAW, 3.5, swing, estimate, motion, calm(estimate), ahead, REST_INPUT)
    assert same[0] == pytest.approx(here[0], abs=1e-6)
    assert same[1] == pytest.approx(here[1], abs=1e-6)


def test_both_poles_of_the_observer_are_at_its_bandwidth() -> None:
    """The poles of its error, from what it believes a moment after one of each."""
    dt = 1e-6
    columns = []
    for v, d in ((1.0, 0.0), (0.0, 1.0)):
        after = observe(observed((v, 0.0, 0.0), (d, 0.0, 0.0)), CALM, CALM, BRISK, dt)
        columns.append((after.v[0], after.d[0]))
    slope = (np.array(columns).T - np.eye(2)) / dt
    b = BRISK.observer_bandwidth
    assert np.poly(slope) == pytest.approx([1.0, 2.0 * b, b * b], rel=1e-3)


@pytest.mark.parametrize("yaw", [0.0, 0.8, math.pi])
def test_rolling_over_a_mass_that_hangs_below_is_no_deviation(yaw: float) -> None:
    """A roll about the centre of mass moves the origin; the centre stays, and so does the law."""
    depth, roll, rate = 0.05, 0.1, 0.7
    turn = Rotation.from_euler("ZYX", [yaw, 0.0, roll])
    down = turn.apply([0.0, 0.0, 1.0])
    level = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    sideways = float(down @ level)
    p = vec3(np.array(PLAN.p) - depth * sideways * level)
    swing = np.cross(turn.apply([rate, 0.0, 0.0]), down) * depth
    estimate = estimate_of(turn, (rate, 0.0, 0.0), p, vec3(-swing))
    motion = MotionState(WEIGHT, CALM, (0.0, 0.0), (0.0, 0.0))
    hanging = (0.0, 0.0, 0.0, -depth, *(0.0,) * 5)
    v = velocity_of_mass(estimate, hanging)
    assert v[:2] == pytest.approx((0.0, 0.0), abs=1e-12)
    seen = observed((v[0], v[1], 0.0), CALM)
    wd, _ = follow_plan(LAW, AIRFRAME.mass, hanging, estimate, motion, seen, PLAN, REST_INPUT)
    assert wd == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_vertical_disturbance_is_met_by_thrust_at_once() -> None:
    estimate, motion = on_plan(Rotation.identity(), PLAN)
    for d in (-0.5, 0.5):
        seen = observed(estimate.v_WB, (0.0, 0.0, d))
        _, thrust = follow_plan(LAW, 3.5, NO_SWING, estimate, motion, seen, PLAN, REST_INPUT)
        expected = 3.5 * (GRAVITY + LAW.gains.k_vertical_disturbance * d)
        assert thrust == pytest.approx(expected)
        assert 0.9 < LAW.gains.k_vertical_disturbance < 1.2


def test_what_was_observed_is_remembered_at_once_and_forgotten_slowly() -> None:
    """A push of 0.1 s in still air; a gentle one later does not shorten its memory."""
    memory, v, history = observed(CALM, CALM, recent=0.0), 0.0, []
    for tick in range(2000):
        push = 0.8 if 500 <= tick < 550 else 0.1 if tick >= 1000 else 0.0
        v += 0.002 * push
        memory = observe(memory, (v, 0.0, 0.0), CALM, BRISK, 0.002)
        history.append(memory.recent)
    assert max(history[:500]) < 1e-12
    assert history[500 + 20] > 0.7  # 40 ms after it began
    assert history[550 + 500] > 0.4  # a second after it ended
    assert history[-1] == pytest.approx(0.8 * math.exp(-1450 * 0.002 / 2.0), rel=0.05)


def test_a_disturbance_that_was_never_observed_counts_as_a_large_one() -> None:
    assert new_tick(AIRFRAME.mass, 4, 2).observed.recent >= 0.8
