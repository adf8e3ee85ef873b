"""Requests to the planner, the plans that are flown, and the counters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.braking import Brake
from fsw.autopilot.flight.plan_exchange import (
    PlanExchange,
    coast,
    measured_state,
    nominal_at_rest,
    planned_input,
    take_answer,
    with_arm_in_bounds,
    with_plan_state,
)
from fsw.autopilot.flight.state import PlanMemory
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.nominal import NominalModel
from fsw.autopilot.model.rotors import MotionState
from fsw.autopilot.mpc.qp_data import InputLimits
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import (
    Plan,
    PlanFailure,
    PlanInput,
    PlanTimings,
    PredictionState,
    SolverStatus,
    Vec3,
)
from fsw.autopilot.tick_record import new_tick
from tests.fsw.paper_arm import LIMIT1, LIMIT12
from tests.fsw.random_states import as_state, estimate_of, prediction_vector, random_estimate
from tests.fsw.records import measured_motion

PERIOD_US, TICK_US, START_US = 100_000, 2_000, 1_000_000
NO_TIME = PlanTimings(0.0, 0.0, 0.0)
MODEL = NominalModel(AIRFRAME, 1e-6 * TICK_US)
STILL: Vec3 = (0.0, 0.0, 0.0)


def moving(v: Vec3 = STILL, yaw_rate: float = 0.0) -> PredictionState:
    return PredictionState(
        STILL, v, STILL, (0.0, 0.0), (0.0, 0.0), 0.0, yaw_rate, (0.0, 0.0), (0.0, 0.0)
    )


def plan(plan_id: int = 3) -> Plan:
    """Inputs numbered by their step."""
    inputs = tuple(PlanInput((float(k), 0.0, 0.0), 0.0, (0.0, 0.0)) for k in range(5))
    return Plan(
        plan_id,
        START_US,
        PERIOD_US,
        moving(),
        inputs,
        SolverStatus.SOLVED,
        0.0,
        0.0,
        (),
        2,
        20,
        NO_TIME,
    )


WAITING = PlanMemory(awaited_id=3, awaited_us=START_US, next_id=4)
REFUSAL = PlanFailure(3, SolverStatus.INFEASIBLE, "no", NO_TIME)


@given(st.integers(0, 3 * PERIOD_US - 1))
def test_the_input_in_use_is_that_of_the_plans_age(age_us: int) -> None:
    u = planned_input(plan(), START_US + age_us)
    assert u is not None
    assert u.a[0] == age_us // PERIOD_US


@pytest.mark.requirement("REQ-PLAN-2")
@pytest.mark.parametrize("age_us", [-1, 3 * PERIOD_US, 10**9])
def test_outside_three_periods_a_plan_is_braked(age_us: int) -> None:
    assert planned_input(plan(), START_US + age_us) is None
    exchange = PlanExchange(flight_config(body="points"))
    r = with_plan_state(new_tick(3.5, 4, 2), moving((1.0, 0.0, 0.0)))
    exchange.follow(PlanMemory(running=plan(), since_us=10**12), r, None, START_US + age_us, 1)
    assert r.plan_input.a[0] < 0.0


def test_a_plan_on_time_starts_where_it_says() -> None:
    memory, new = take_answer(WAITING, plan(), START_US)
    assert new is not None
    assert (memory.running, memory.since_us, memory.awaited_id) == (new, START_US, -1)
    assert (memory.counters.plans, memory.counters.missed_deadlines) == (1, 0)
    exchange = PlanExchange(flight_config(body="points"))
    r = with_plan_state(new_tick(3.5, 4, 2), moving())
    exchange.follow(WAITING, r, plan(), START_US, 1)
    assert r.plan_state == new.start


@pytest.mark.requirement("REQ-PLAN-1")
def test_a_late_plan_is_missed_once_and_starts_where_it_would_be_by_now() -> None:
    memory = WAITING
    for late in range(3):
        memory, new = take_answer(memory, None, START_US + late * TICK_US)
        assert new is None
        assert memory.counters.missed_deadlines == 1
    now_us = START_US + 3 * TICK_US
    new = plan()
    r = with_plan_state(new_tick(3.5, 4, 2), moving())
    memory = PlanExchange(flight_config(body="points")).follow(memory, r, new, now_us, 1)
    assert (memory.counters.missed_deadlines, memory.counters.plans) == (1, 1)
    assert r.plan_state == MODEL.advance(new.start, new.inputs[0], 3)
    assert r.plan_input == new.inputs[0]


def test_before_its_time_nothing_is_missed() -> None:
    assert take_answer(WAITING, None, START_US - TICK_US) == (WAITING, None)


@pytest.mark.requirement("REQ-PLAN-1")
def test_a_refusal_is_counted_and_the_running_plan_goes_on() -> None:
    running = plan(2)
    memory, new = take_answer(
        PlanMemory(running=running, awaited_id=3, awaited_us=START_US), REFUSAL, START_US
    )
    assert new is None
    assert memory.running is running
    assert (memory.refused, memory.reason) == (True, REFUSAL.reason)
    assert memory.counters.fallbacks == 1


def test_an_answer_to_another_question_is_nobodys() -> None:
    memory, new = take_answer(WAITING, plan(2), START_US)
    assert new is None
    assert memory.running is None


def test_measured_yaw_rate_is_that_of_the_zyx_angles() -> None:
    random, moment = np.random.default_rng(1), 1e-6
    for _ in range(20):
        estimate = random_estimate(random, tilt=0.8)
        motion = measured_motion(AIRFRAME, estimate, (8.0, 8.0, 8.0, 8.0))
        R_WB = Rotation.from_matrix(np.reshape(estimate.R_WB, (3, 3)))
        turn = Rotation.from_rotvec(moment * np.array(estimate.w_WB_B))
        change = (R_WB * turn).as_euler("ZYX")[0] - (R_WB * turn.inv()).as_euler("ZYX")[0]
        wrapped = (change + math.pi) % (2.0 * math.pi) - math.pi
        state = measured_state(estimate, motion)
        assert state.yaw_rate == pytest.approx(wrapped / (2.0 * moment), abs=1e-5)


def test_measured_state_is_the_vehicle() -> None:
    estimate = estimate_of(
        Rotation.from_euler("Z", 1.0), STILL, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), (0.4, 0.5)
    )
    motion = measured_motion(AIRFRAME, estimate, (9.0, 8.0, 8.0, 8.0))
    state = measured_state(estimate, motion)
    assert (state.p, state.v, state.q_arm) == (estimate.p_WB, estimate.v_WB, estimate.q_arm)
    assert (state.a, state.j, state.s) == (motion.a, motion.j, motion.s)
    assert state.yaw == pytest.approx(1.0)


def test_a_plan_s_state_at_rest_is_the_vehicle_s_place_and_pose_and_does_not_move() -> None:
    estimate = random_estimate(np.random.default_rng(2))
    still = nominal_at_rest(estimate)
    place = (estimate.p_WB, estimate.yaw, estimate.q_arm)
    assert (still.p, still.yaw, still.q_arm) == place
    assert (still.v, still.a, still.j, still.s) == (STILL, STILL, (0.0, 0.0), (0.0, 0.0))
    assert (still.yaw_rate, still.qd_arm) == (0.0, (0.0, 0.0))


def test_a_slung_arm_is_planned_from_the_nearest_pose_it_may_have() -> None:
    estimate = random_estimate(np.random.default_rng(3))
    still = (0.0, 0.0, 0.0)
    measured = measured_state(estimate, MotionState(30.0, still, (0.0, 0.0), (0.0, 0.0)))
    limits = InputLimits(joint_rate=2.0, joint_margin=0.1)
    far = measured._replace(q_arm=(2.0, 3.0), qd_arm=(-20.0, 15.0))
    slung = with_arm_in_bounds(far, AIRFRAME, limits)
    assert slung.q_arm[0] == LIMIT1 - 0.1
    assert sum(slung.q_arm) == pytest.approx(LIMIT12 - 0.1)
    assert slung.qd_arm == (-2.0, 2.0)
    within = measured._replace(q_arm=(0.3, -0.5), qd_arm=(1.0, -2.0))
    same = with_arm_in_bounds(within, AIRFRAME, limits)
    assert same.q_arm == pytest.approx(within.q_arm)
    assert same._replace(q_arm=within.q_arm) == within


@given(st.floats(0.0, 0.2), st.floats(0.0, 0.2), st.integers(0, 2**31))
def test_coasting_for_a_while_and_then_some_more_is_coasting_for_both(
    first: float, second: float, seed: int
) -> None:
    x = as_state(prediction_vector(np.random.default_rng(seed)))
    at_once, in_parts = coast(x, first + second), coast(coast(x, first), second)
    for got, expected in zip(in_parts, at_once, strict=True):
        assert got == pytest.approx(expected, abs=1e-9)


def test_coasting_moves_every_quantity_by_its_rate_and_holds_the_jerk() -> None:
    x, moment = as_state(prediction_vector(np.random.default_rng(1))), 1e-6
    after = coast(x, moment)

    def rate(name: str) -> Any:
        return (np.array(getattr(after, name)) - np.array(getattr(x, name))) / moment

    np.testing.assert_allclose(rate("p"), x.v, atol=1e-4)
    np.testing.assert_allclose(rate("v"), x.a, atol=1e-4)
    np.testing.assert_allclose(rate("a"), (*x.j, 0.0), atol=1e-4)
    np.testing.assert_allclose(rate("yaw"), x.yaw_rate, atol=1e-4)
    np.testing.assert_allclose(rate("q_arm"), x.qd_arm, atol=1e-4)
    kept = (x.j, x.s, x.yaw_rate, x.qd_arm)
    assert (after.j, after.s, after.yaw_rate, after.qd_arm) == kept


FLOWN = flight_config(body="points")
EXCHANGE = PlanExchange(FLOWN)
DELAY_S = 1e-6 * FLOWN.plan_delay_ticks * FLOWN.tick_period_us


@pytest.mark.parametrize("distance", [0.149, 0.151])
@pytest.mark.parametrize("turn", [0.0, 0.349, 0.351, 2.0 * math.pi - 0.349])
def test_off_its_plan_the_vehicle_is_planned_from_where_it_will_be(
    distance: float, turn: float
) -> None:
    """By its own motion, jerk and all; near to the plan, from the plan."""
    nominal = moving((0.2, 0.0, 0.0))
    measured = nominal._replace(
        p=(0.0, distance, 0.0), v=(0.4, 0.0, 0.1), a=(1.0, 0.0, 0.0), j=(50.0, -30.0), yaw=turn
    )
    start, is_nominal = EXCHANGE.start(PlanMemory(), nominal, measured, START_US)
    assert is_nominal is (distance < 0.15 and turn != 0.351)
    if not is_nominal:
        assert start.p == pytest.approx(coast(measured, DELAY_S).p)
        assert start.v == pytest.approx(coast(measured, DELAY_S).v)
        assert start.a[0] == pytest.approx(1.0 + DELAY_S * 50.0)
    else:
        ticks = FLOWN.plan_delay_ticks
        model = NominalModel(FLOWN.airframe, 1e-6 * FLOWN.tick_period_us)
        brake = Brake(FLOWN.airframe, FLOWN.planner.limits.tilt)
        assert start == model.advance(nominal, brake(nominal), ticks)


def test_a_pid_loop_is_planned_from_the_measurement_however_near() -> None:
    exchange = PlanExchange(flight_config(inner="pid", body="points"))
    measured = moving((0.1, 0.0, 0.0))
    start, is_nominal = exchange.start(PlanMemory(), measured, measured, START_US)
    assert not is_nominal
    assert start.p == pytest.approx((0.1 * DELAY_S, 0.0, 0.0))


def test_an_arm_that_was_slung_about_is_caught_before_it_is_planned_on() -> None:
    slung = moving()._replace(p=(1.0, 0.0, 0.0), q_arm=(2.0, 1.0), qd_arm=(9.0, -9.0))
    start, _ = EXCHANGE.start(PlanMemory(), moving(), slung, START_US)
    assert start.qd_arm == (3.0, -3.0)
    assert abs(start.q_arm[0] - DELAY_S * 3.0) <= LIMIT1 + 1e-12
