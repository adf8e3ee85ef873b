"""Plan exchange: requests to the planner, the start of its plans, the state of a running one."""

from __future__ import annotations

import math
from collections.abc import Callable

from fsw.autopilot.control.braking import Brake
from fsw.autopilot.control.joints import rest_joints
from fsw.autopilot.flight.failsafe.evidence import PLAN_STALE_PERIODS
from fsw.autopilot.flight.state import FlightState, PlanMemory
from fsw.autopilot.geometry.rotation import wrap_angle
from fsw.autopilot.geometry.vectors import clamp_magnitude
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.arm_coordinates import arm_coordinates, within_limits
from fsw.autopilot.model.nominal import NominalModel, rest_state
from fsw.autopilot.model.rotors import MotionState
from fsw.autopilot.mpc.qp_data import InputLimits
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import Plan, PlanFailure, PlanInput, PredictionState, StateEstimate, Vec3
from fsw.autopilot.tick_record import Tick
from fsw.frozen import replace


def nominal_at_rest(estimate: StateEstimate) -> PredictionState:
    """A plan state at rest at the vehicle's position."""
    rest = rest_state(len(estimate.q_arm))
    return rest._replace(p=estimate.p_WB, yaw=estimate.yaw, q_arm=estimate.q_arm)


def measured_state(estimate: StateEstimate, motion: MotionState) -> PredictionState:
    """The vehicle itself as a state of the prediction model."""
    R = estimate.R_WB
    _, wy, wz = estimate.w_WB_B
    # ZYX yaw rate: the body rates' share about the vertical, over the cosine of pitch squared.
    yaw_rate = (R[7] * wy + R[8] * wz) / max(R[7] * R[7] + R[8] * R[8], 1e-6)
    return PredictionState(
        p=estimate.p_WB,
        v=estimate.v_WB,
        a=motion.a,
        j=motion.j,
        s=motion.s,
        yaw=estimate.yaw,
        yaw_rate=yaw_rate,
        q_arm=estimate.q_arm,
        qd_arm=estimate.qd_arm,
    )


def with_arm_in_bounds(
    x: PredictionState, airframe: Airframe, limits: InputLimits
) -> PredictionState:
    """The state with the arm in the nearest pose and at the nearest rate to plan from.

    A hard push slings the arm about. A plan that began from that pose would need seconds to
    catch it, and the arm would follow the plan round and round.
    """
    q_arm = within_limits(arm_coordinates(airframe), x.q_arm, limits.joint_margin)
    rates = tuple([clamp_magnitude(rate, limits.joint_rate) for rate in x.qd_arm])
    return x._replace(q_arm=q_arm, qd_arm=rates)


def coast(x: PredictionState, seconds: float) -> PredictionState:
    """Predict a measured state over ``seconds`` [s] at constant jerk.

    Off its plan the vehicle follows the tracking loop's correction, not the plan's input, so its
    own motion predicts better.
    """
    t, j = seconds, (*x.j, 0.0)
    return x._replace(
        p=_each(lambda k: x.p[k] + t * (x.v[k] + t * (x.a[k] / 2.0 + t * j[k] / 6.0))),
        v=_each(lambda k: x.v[k] + t * (x.a[k] + t * j[k] / 2.0)),
        a=_each(lambda k: x.a[k] + t * j[k]),
        yaw=x.yaw + t * x.yaw_rate,
        q_arm=tuple([q + t * qd for q, qd in zip(x.q_arm, x.qd_arm, strict=True)]),
    )


def _each(value: Callable[[int], float]) -> Vec3:
    return value(0), value(1), value(2)


def planned_input(plan: Plan | None, now_us: int) -> PlanInput | None:
    """A plan's input at its age; None where it is not young enough, or there is none."""
    if plan is None:
        return None
    step = (now_us - plan.t_us) // plan.period_us
    young = 0 <= step < PLAN_STALE_PERIODS and step < len(plan.inputs)
    return plan.inputs[step] if young else None


def take_answer(
    memory: PlanMemory, answer: Plan | PlanFailure | None, now_us: int
) -> tuple[PlanMemory, Plan | None]:
    """Account for the planner: a plan starts, a refusal is counted, a missing one is noticed.

    Returns the memory after this tick, and the plan where one starts now.
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
            memory,
            awaited_id=-1,
            status=answer.status,
            refused=True,
            reason=answer.reason,
            counters=counters,
        )
        return refused, None
    if now_us >= memory.awaited_us and not memory.awaited_missed:
        counters = replace(counters, missed_deadlines=counters.missed_deadlines + 1)
        return replace(memory, awaited_missed=True, counters=counters), None
    return memory, None


class PlanExchange:
    """Requests to the planner and its plans, for one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        self.model = NominalModel(config.airframe, config.tick)
        self._brake = Brake(config.airframe, config.planner.limits.tilt)

    def follow(
        self,
        memory: PlanMemory,
        r: Tick,
        answer: Plan | PlanFailure | None,
        now_us: int,
        ticks: int,
    ) -> PlanMemory:
        """Bring the plan's state of the last tick to this one, by a new plan or by as many steps.

        ``ticks`` passed since, more than one where some were missed. Reads plan; writes plan, u.
        """
        tick_us, running = self._config.tick_period_us, memory.running
        memory, new_plan = take_answer(memory, answer, now_us)
        if new_plan is not None:
            late = max(now_us - new_plan.t_us, 0) // tick_us
            r.plan_state, r.plan_input = new_plan.start, new_plan.inputs[0]
            self.model.move(r, late)
        elif now_us > memory.since_us:
            for ago in range(ticks, 0, -1):
                self._steer(running, r, now_us - ago * tick_us)
                self.model.move(r, 1)
        self._steer(memory.running, r, now_us)
        return memory

    def _steer(self, plan: Plan | None, r: Tick, now_us: int) -> None:
        """Write the running plan's input, or braking where there is none young enough."""
        if (u := planned_input(plan, now_us)) is None:
            nominal = r.plan_state
            assert nominal is not None
            u = self._brake(nominal)
        r.plan_input = u

    def start(
        self,
        memory: PlanMemory,
        nominal: PredictionState,
        measured: PredictionState,
        now_us: int,
        replan: bool = False,
    ) -> tuple[PredictionState, bool]:
        """The state from which to plan, and whether it is the running plan's own.

        It is that as long as the fast loop holds the vehicle to it, and the measurement otherwise:
        with the PID inner loop, which follows no state, after an upset, and to ``replan`` a vehicle
        that has left the tube around its plan. Either is moved on to the instant the answer takes
        effect.
        """
        config, delay = self._config, self._config.plan_delay_ticks
        from_nominal = (
            not replan
            and config.follows_plan
            and math.dist(nominal.p, measured.p) < config.upset_distance
            and abs(wrap_angle(nominal.yaw - measured.yaw)) < config.upset_yaw
        )
        if from_nominal:
            u = planned_input(memory.running, now_us) or self._brake(nominal)
            return self.model.advance(nominal, u, delay), True
        settled = with_arm_in_bounds(measured, config.airframe, config.planner.limits)
        return coast(settled, delay * config.tick), False


def requested(memory: PlanMemory, apply_us: int) -> PlanMemory:
    """The memory after the next request; an unanswered one is dropped."""
    counters = memory.counters
    if memory.awaited_id >= 0:
        counters = replace(counters, fallbacks=counters.fallbacks + 1)
    return replace(
        memory,
        awaited_id=memory.next_id,
        awaited_us=apply_us,
        awaited_missed=False,
        next_id=memory.next_id + 1,
        counters=counters,
    )


def without_plan(state: FlightState, estimate: StateEstimate) -> FlightState:
    """No plan runs yet, its state is the vehicle's, and the count of requests goes on."""
    last = state.plan
    plan = PlanMemory(since_us=estimate.t_us, next_id=last.next_id, counters=last.counters)
    record = with_plan_state(state.record, nominal_at_rest(estimate))
    return replace(state, record=record, plan=plan)


def resumed(
    config: FlightConfig, state: FlightState, estimate: StateEstimate, motion: MotionState
) -> FlightState:
    """The state after a time without ticks: no plan; brake from the measured ``motion``.

    Over few missed ticks the plan is moved on as if they had been there. Over more, nothing that
    the loops remember says what happened: what moved the vehicle meanwhile was not their last
    command, and an observer would take it for a disturbance. They go on from what they have
    learned, but from no motion; of the disturbance its lasting part is kept, wind.
    """
    measured = measured_state(estimate, motion)
    settled = with_arm_in_bounds(measured, config.airframe, config.planner.limits)
    state = without_plan(state, estimate)
    r = with_plan_state(state.record, settled)
    r.observed.v[:] = estimate.v_WB
    r.observed.d[:2], r.observed.d[2] = r.observed.disturbance_bias, 0.0
    rest_joints(r.joints, config.airframe, estimate)
    return replace(state, record=r)


def with_plan_state(r: Tick, nominal: PredictionState) -> Tick:
    """A record with another state of the plan."""
    r = r.copy()
    r.plan_state = nominal
    return r
