"""Between tick and planner: what is asked, what is flown, what is counted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.control.braking import Brake
from fsw.model.airframe import AIRFRAME
from fsw.model.nominal import NominalModel
from fsw.model.rotors import MotionState, motion_state
from fsw.mpc.qp_data import InputLimits
from fsw.runtime.flight_state import PlanMemory
from fsw.runtime.planning import (
    late_start,
    measured_state,
    plan_input,
    take_answer,
    with_arm_in_bounds,
)
from fsw.signals import (
    Plan,
    PlanFailure,
    PlanInput,
    PlanTimings,
    PredictionState,
    SolverStatus,
    Vec3,
)
from tests.fsw.random_states import estimate_of, random_estimate

PERIOD_US, TICK_US, START_US = 100_000, 2_000, 1_000_000
NO_TIME = PlanTimings(0.0, 0.0, 0.0)
MODEL = NominalModel(AIRFRAME, 1e-6 * TICK_US)
BRAKE = Brake(AIRFRAME, InputLimits().tilt)
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
    u = plan_input(plan(), moving((1.0, 0.0, 0.0)), START_US + age_us, BRAKE)
    assert u.a[0] == age_us // PERIOD_US


@pytest.mark.parametrize("age_us", [-1, 3 * PERIOD_US, 10**9])
def test_outside_three_periods_a_plan_is_braked(age_us: int) -> None:
    assert plan_input(plan(), moving((1.0, 0.0, 0.0)), START_US + age_us, BRAKE).a[0] < 0.0


def test_a_plan_on_time_starts_where_it_says() -> None:
    memory, new = take_answer(WAITING, plan(), START_US)
    assert new is not None
    assert (memory.running, memory.since_us, memory.awaited_id) == (new, START_US, -1)
    assert (memory.counters.plans, memory.counters.missed_deadlines) == (1, 0)
    assert late_start(MODEL, new, START_US, TICK_US) == new.start


def test_a_late_plan_is_missed_once_and_starts_where_it_would_be_by_now() -> None:
    memory = WAITING
    for late in range(3):
        memory, new = take_answer(memory, None, START_US + late * TICK_US)
        assert new is None
        assert memory.counters.missed_deadlines == 1
    now_us = START_US + 3 * TICK_US
    memory, new = take_answer(memory, plan(), now_us)
    assert new is not None
    assert (memory.counters.missed_deadlines, memory.counters.plans) == (1, 1)
    expected = MODEL.advance(new.start, new.inputs[0], 3)
    assert late_start(MODEL, new, now_us, TICK_US) == expected


def test_before_its_time_nothing_is_missed() -> None:
    assert take_answer(WAITING, None, START_US - TICK_US) == (WAITING, None)


def test_a_refusal_is_counted_and_the_running_plan_goes_on() -> None:
    running = plan(2)
    memory, new = take_answer(
        PlanMemory(running=running, awaited_id=3, awaited_us=START_US), REFUSAL, START_US
    )
    assert new is None
    assert memory.running is running
    assert memory.refused
    assert memory.counters.fallbacks == 1


def test_an_answer_to_another_question_is_nobodys() -> None:
    memory, new = take_answer(WAITING, plan(2), START_US)
    assert new is None
    assert memory.running is None


def test_measured_yaw_rate_is_that_of_the_zyx_angles() -> None:
    random, moment = np.random.default_rng(1), 1e-6
    for _ in range(20):
        estimate = random_estimate(random, tilt=0.8)
        motion = motion_state(AIRFRAME, AIRFRAME.mass, estimate, (8.0, 8.0, 8.0, 8.0), 0.0)
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
    motion = motion_state(AIRFRAME, AIRFRAME.mass, estimate, (9.0, 8.0, 8.0, 8.0), 0.0)
    state = measured_state(estimate, motion)
    assert (state.p, state.v, state.q_arm) == (estimate.p_WB, estimate.v_WB, estimate.q_arm)
    assert (state.a, state.j, state.s) == (motion.a, motion.j, motion.s)
    assert state.yaw == pytest.approx(1.0)


def test_a_slung_arm_is_planned_from_the_nearest_pose_it_may_have() -> None:
    estimate = random_estimate(np.random.default_rng(3))
    still = (0.0, 0.0, 0.0)
    measured = measured_state(estimate, MotionState(30.0, still, (0.0, 0.0), (0.0, 0.0)))
    slung = with_arm_in_bounds(measured._replace(q_arm=(2.0, 3.0), qd_arm=(-20.0, 15.0)), AIRFRAME)
    assert slung.q_arm[0] == AIRFRAME.joint1_limit
    assert sum(slung.q_arm) == pytest.approx(AIRFRAME.joint12_limit)
    assert slung.qd_arm == (-3.0, 3.0)
    within = measured._replace(q_arm=(0.3, -0.5), qd_arm=(1.0, -2.0))
    same = with_arm_in_bounds(within, AIRFRAME)
    assert same.q_arm == pytest.approx(within.q_arm)
    assert same._replace(q_arm=within.q_arm) == within
