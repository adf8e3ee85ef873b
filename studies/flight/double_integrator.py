"""The paper's own prediction model as the plant: six double integrators (eq 16).

The commanded acceleration is reached at once and the disturbance adds to it; the body stays
level. The same trajectories, safe sets, disturbances and evaluator as in the full plant, so
that only the plant differs. Motion between disturbance changes is a parabola and is judged
every exchange of 2 ms.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fsw.autopilot.control.braking import Brake
from fsw.autopilot.flight.plan_exchange import planned_input
from fsw.autopilot.geometry.vectors import add, subtract, three
from fsw.autopilot.model.kinematics import level_frame, position
from fsw.autopilot.model.multibody import Bodies, bodies_of
from fsw.autopilot.model.nominal import rest_state
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import Plan, PlanInput, PlanRequest, PredictionState
from sitl.disturbances.items import push
from sitl.flight_evaluator import FlightEvaluator
from sitl.mission_clock import MissionClock
from sitl.plant.vector import Array
from sitl.result import EndReason, TruthResult
from sitl.scenario import V3, Scenario, start_angles, vehicle_of
from sitl.scenario_validation import check
from sitl.simulation import SAMPLE_STEPS, START_US, STEP_US
from studies.flight.collector import collector_off
from studies.flight.mission import safe_set, target
from studies.flight.own_parts import planner_of
from studies.flight.result import (
    TRACE_STEPS,
    FlightRecorder,
    FlightResult,
    TracePoint,
    touched,
)

_STEP_S = 1e-6 * STEP_US


def after(state: PredictionState, u: PlanInput, push_W: V3, dt: float) -> PredictionState:
    """The state ``dt`` [s] later, under a constant input and disturbance, exactly.

    ``push_W`` [m/s^2] disturbs; acceleration, jerk and snap are none of this plant's states and
    stay.
    """
    a = (u.a[0] + push_W[0], u.a[1] + push_W[1], u.a[2] + push_W[2])
    p, v, half = state.p, state.v, 0.5 * dt * dt
    arm = zip(state.q_arm, state.qd_arm, u.qdd_arm, strict=True)
    return state._replace(
        p=(
            p[0] + dt * v[0] + half * a[0],
            p[1] + dt * v[1] + half * a[1],
            p[2] + dt * v[2] + half * a[2],
        ),
        v=(v[0] + dt * a[0], v[1] + dt * a[1], v[2] + dt * a[2]),
        yaw=state.yaw + dt * state.yaw_rate + half * u.yaw_acc,
        yaw_rate=state.yaw_rate + dt * u.yaw_acc,
        q_arm=tuple(q + dt * qd + half * qdd for q, qd, qdd in arm),
        qd_arm=tuple(qd + dt * qdd for qd, qdd in zip(state.qd_arm, u.qdd_arm, strict=True)),
    )


def places(bodies: Bodies, state: PredictionState) -> Array:
    """Base, joints, end-effector of the level body (2 + j, 3) [m, NED], as the plant has them."""
    frame, n = level_frame(bodies, state.q_arm, state.yaw), bodies.joints
    local = [position(frame, k, (0.0, 0.0, 0.0)) for k in range(n + 1)]
    return np.array([add(state.p, one) for one in (*local, position(frame, n, bodies.tip))])


class DoubleIntegrator:
    """The plant in its scenario; mirrors ``sitl.simulation.Simulation``.

    Raises:
        ScenarioError: The scenario contradicts itself or starts outside its safe set.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        check(scenario)
        self.clock = MissionClock(scenario)
        self.step = 0
        self._bodies = bodies_of(vehicle_of(scenario))
        self.state = _first_state(self._bodies, scenario, self.clock.target_at(0.0).p)
        self._pushes = [push(item, seed, _STEP_S) for item in scenario.disturbances]
        scenario = replace(scenario, body="points")  # there is no attitude that a body could have
        self.evaluator = FlightEvaluator(scenario, self.clock, self.places)

    @property
    def places(self) -> Array:
        """See :func:`places`."""
        return places(self._bodies, self.state)

    @property
    def time_s(self) -> float:
        """Seconds since the start."""
        return _STEP_S * self.step

    @property
    def t_us(self) -> int:
        """Time stamp of the current state [us]."""
        return START_US + STEP_US * self.step

    @property
    def ended(self) -> EndReason | None:
        """Why the run is over, None while it is not."""
        return self.evaluator.ended

    def advance(self, u: PlanInput) -> None:
        """One exchange of 2 ms under an input, judged at its end."""
        push_W = self._push()
        self.state = after(self.state, u, push_W, _STEP_S)
        self.step += 1
        now = self.places
        self.evaluator.judge(now, self.time_s, _STEP_S)
        if self.step % SAMPLE_STEPS == 0:
            self.evaluator.sample_error(now, self.time_s)
        self.evaluator.judge_time(self.time_s)

    def result(self) -> TruthResult:
        """The score so far."""
        return self.evaluator.result(self.time_s)

    def _push(self) -> V3:
        x = y = z = 0.0
        for item in self._pushes:
            dx, dy, dz = item.sample(self.step)
            if not item.torque:  # a point has no attitude to disturb
                x, y, z = x + dx, y + dy, z + dz
        return x, y, z


@collector_off()
def simulate(
    scenario: Scenario, seed: int, config: FlightConfig, *, traced: bool = False
) -> FlightResult:
    """Fly the planner alone on the double integrators: measured start, no delay, no fast loop.

    The scenario's trajectory starts in the air; the planner's airframe is to be one with
    ``AttitudeLag(at_once=True)``. ``traced`` keeps the truth for figures.
    """
    plant = DoubleIntegrator(scenario, seed)
    planner = planner_of(config)
    brake = Brake(config.airframe, config.planner.limits.tilt)
    recorder = FlightRecorder()
    held, running = safe_set(scenario), None
    steps = config.mpc_period_us // STEP_US
    while plant.ended is None:
        start, t_us = plant.state, plant.t_us
        targets = tuple(
            target(plant.clock, t_us + node * config.mpc_period_us)
            for node in range(config.planner.horizon + 1)
        )
        answer = planner.plan(
            PlanRequest(
                plan_id=len(recorder.step_us),
                t_apply_us=t_us,
                start=start,
                targets=targets,
                safe_set=held,
                from_nominal=False,
            )
        )
        recorder.planned(answer)
        running = answer if isinstance(answer, Plan) else running
        # As in flight: without an answer the running plan goes on, then the vehicle brakes.
        u = planned_input(running, t_us) or brake(start)
        recorder.metrics.add(u)
        for _ in range(steps):
            if traced and plant.step % TRACE_STEPS == 0:
                recorder.trace.append(_trace_point(plant))
            if plant.ended is None:
                plant.advance(u)
    return FlightResult(plant.result(), recorder, touched(plant.ended))


def _first_state(bodies: Bodies, scenario: Scenario, p_target: V3) -> PredictionState:
    yaw, angles = math.radians(scenario.start.yaw_deg), start_angles(scenario)
    at_origin = rest_state(bodies.joints)._replace(yaw=yaw, q_arm=angles)
    return at_origin._replace(p=subtract(p_target, places(bodies, at_origin)[-1]))


def _trace_point(plant: DoubleIntegrator) -> TracePoint:
    now, p_WB = plant.places, plant.state.p
    margins = plant.evaluator.margins(now, plant.time_s)
    aim, p_WE = plant.clock.target_at(plant.time_s).p, three(now[-1], 0)
    least = min(margins, default=math.inf)
    return TracePoint(t_s=plant.time_s, p_WB=p_WB, p_WE=p_WE, p_target=aim, margin_m=least)
