"""Between tick and planner: when to ask, what to ask, what to fly while the answer ages."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from fsw.control.braking import Brake
from fsw.geometry.rotation import wrap_angle
from fsw.model.airframe import Airframe
from fsw.model.nominal import NominalModel
from fsw.model.rotors import MotionState
from fsw.parameters.flight_config import FlightConfig
from fsw.runtime.flight_state import PlanMemory
from fsw.signals import (
    EndEffectorTarget,
    Plan,
    PlanFailure,
    PlanInput,
    PlanRequest,
    PredictionState,
    SafeSet,
    StateEstimate,
    Vec2,
    Vec3,
)
from fsw.vehicle.faults import PLAN_STALE_PERIODS

_JOINT_RATE = 3.0  # rad/s, which the plan stops within its horizon


def nominal_at_rest(estimate: StateEstimate) -> PredictionState:
    """A plan state that stands where the vehicle is."""
    return PredictionState(
        estimate.p_WB,
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (0.0, 0.0),
        (0.0, 0.0),
        estimate.yaw,
        0.0,
        estimate.q_arm,
        (0.0, 0.0),
    )


def measured_state(estimate: StateEstimate, motion: MotionState) -> PredictionState:
    """The vehicle itself as a state of the prediction model."""
    R = estimate.R_WB
    _, wy, wz = estimate.w_WB_B
    # ZYX yaw rate: the body rates' share about the vertical, over the cosine of pitch squared.
    yaw_rate = (R[7] * wy + R[8] * wz) / max(R[7] * R[7] + R[8] * R[8], 1e-6)
    return PredictionState(
        estimate.p_WB,
        estimate.v_WB,
        motion.a,
        motion.j,
        motion.s,
        estimate.yaw,
        yaw_rate,
        estimate.q_arm,
        estimate.qd_arm,
    )


def with_arm_in_bounds(x: PredictionState, airframe: Airframe) -> PredictionState:
    """The state with the arm in the nearest pose and at the nearest rate to plan from.

    A hard push slings the arm about. A plan that began with it so would need seconds to catch it,
    and the arm would follow the plan round and round.
    """
    th1 = _clip(x.q_arm[0], airframe.joint1_limit)
    th12 = _clip(x.q_arm[0] + x.q_arm[1], airframe.joint12_limit)
    first, second = x.qd_arm
    rates = (_clip(first, _JOINT_RATE), _clip(second, _JOINT_RATE))
    return x._replace(q_arm=(th1, th12 - th1), qd_arm=rates)


def _clip(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)


def coast(x: PredictionState, seconds: float) -> PredictionState:
    """A measured state a moment later, its jerk held.

    Off its plan the vehicle does what the fast loop makes of the error, not what the plan's
    input says; its own motion is the better guess.
    """
    t, j = seconds, (*x.j, 0.0)
    return x._replace(
        p=_each(lambda k: x.p[k] + t * (x.v[k] + t * (x.a[k] / 2.0 + t * j[k] / 6.0))),
        v=_each(lambda k: x.v[k] + t * (x.a[k] + t * j[k] / 2.0)),
        a=_each(lambda k: x.a[k] + t * j[k]),
        yaw=x.yaw + t * x.yaw_rate,
        q_arm=(x.q_arm[0] + t * x.qd_arm[0], x.q_arm[1] + t * x.qd_arm[1]),
    )


def _each(value: Callable[[int], float]) -> Vec3:
    return value(0), value(1), value(2)


def plan_input(plan: Plan | None, nominal: PredictionState, now_us: int, brake: Brake) -> PlanInput:
    """The running plan's input at its age; braking where there is none young enough."""
    if plan is not None:
        step = (now_us - plan.t_us) // plan.period_us
        if 0 <= step < min(PLAN_STALE_PERIODS, len(plan.inputs)):
            return plan.inputs[step]
    return brake(nominal)


def take_answer(
    memory: PlanMemory, answer: Plan | PlanFailure | None, now_us: int
) -> tuple[PlanMemory, Plan | None]:
    """Account for the planner: a plan starts, a refusal is counted, a missing one is noticed.

    Args:
        memory: Before this tick.
        answer: What arrived, at most one.
        now_us: This tick.

    Returns:
        The memory, and the plan where one starts now.
    """
    if memory.awaited_id < 0:
        return memory, None
    counters = memory.counters
    if answer is not None and answer.plan_id == memory.awaited_id:
        if isinstance(answer, Plan):
            taken = replace(
                memory,
                awaited_id=-1,
                running=answer,
                since_us=answer.t_us,
                status=answer.status,
                refused=False,
                counters=replace(counters, plans=counters.plans + 1),
            )
            return taken, answer
        counters = replace(counters, fallbacks=counters.fallbacks + 1)
        refused = replace(
            memory, awaited_id=-1, status=answer.status, refused=True, counters=counters
        )
        return refused, None
    if now_us >= memory.awaited_us and not memory.awaited_missed:
        counters = replace(counters, missed_deadlines=counters.missed_deadlines + 1)
        return replace(memory, awaited_missed=True, counters=counters), None
    return memory, None


def late_start(model: NominalModel, plan: Plan, now_us: int, dt_us: int) -> PredictionState:
    """Where a plan wants the vehicle on the tick it arrives."""
    return model.advance(plan.start, plan.inputs[0], max(now_us - plan.t_us, 0) // dt_us)


def ask(
    config: FlightConfig,
    model: NominalModel,
    brake: Brake,
    memory: PlanMemory,
    nominal: PredictionState,
    measured: PredictionState,
    safe_set: SafeSet,
    targets: tuple[EndEffectorTarget, ...],
    joint_targets: tuple[Vec2, ...],
    now_us: int,
) -> tuple[PlanRequest, PlanMemory]:
    """The question for this period.

    The plan starts from the running plan's own state as long as the fast loop holds the
    vehicle to it, and from the measurement otherwise: with the PID inner loop, which
    follows no state, and after an upset. Either is moved on to the instant the answer
    takes effect.
    """
    from_nominal = (
        config.inner == "tracking"
        and math.dist(nominal.p, measured.p) < config.upset_distance
        and abs(wrap_angle(nominal.yaw - measured.yaw)) < config.upset_yaw
    )
    delay = config.plan_delay_ticks
    if from_nominal:
        start = model.advance(nominal, plan_input(memory.running, nominal, now_us, brake), delay)
    else:
        settled = with_arm_in_bounds(measured, config.airframe)
        start = coast(settled, delay * config.tick_period_us * 1e-6)
    apply_us = now_us + delay * config.tick_period_us
    request = PlanRequest(
        memory.next_id,
        apply_us,
        start,
        targets,
        safe_set,
        from_nominal,
        joint_targets=joint_targets,
    )
    counters = memory.counters
    if memory.awaited_id >= 0:  # the last question is given up, not waited for
        counters = replace(counters, fallbacks=counters.fallbacks + 1)
    return request, replace(
        memory,
        awaited_id=memory.next_id,
        awaited_us=apply_us,
        awaited_missed=False,
        next_id=memory.next_id + 1,
        counters=counters,
    )
