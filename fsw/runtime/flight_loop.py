"""One tick of the flight software, top to bottom: (state, inputs) -> (state, outputs).

No clock, socket, thread or random number: real time, lockstep, replay and tests all call
this. ``FlightLoop.tick`` reads in the order things happen.
"""

from __future__ import annotations

from dataclasses import replace

from fsw.barriers.margins import constraint_report
from fsw.barriers.root import BarrierTuning
from fsw.control.attitude import attitude_reference
from fsw.control.cascade import Cascade, at_rest, in_hover
from fsw.estimation.estimator import estimate_state
from fsw.model.arm_kinematics import point_in_flight
from fsw.model.nominal import NominalModel
from fsw.mpc.reference import merge
from fsw.parameters.flight_config import FlightConfig
from fsw.runtime.flight_state import FlightState, PlanMemory
from fsw.runtime.mode_reference import mode_reference
from fsw.runtime.planning import ask, nominal_at_rest, plan_input, take_answer
from fsw.signals import (
    ActuatorCommand,
    CommandAck,
    CommandRequest,
    ConstraintKind,
    EndEffectorTarget,
    FlightSnapshot,
    Mode,
    PlanInput,
    PlanRequest,
    StateEstimate,
    StatusText,
    TickInputs,
    TickOutputs,
    Vec3,
)
from fsw.vehicle.commands import Situation, decide
from fsw.vehicle.faults import RESPONSES, Evidence, Response, detect
from fsw.vehicle.modes import Event, next_mode
from fsw.vehicle.safety_gate import STOPPED, gate

_WARNING, _NOTICE, _EMERGENCY = 4, 5, 0  # MAV_SEVERITY
_IDLE_INPUT = PlanInput((0.0, 0.0, 0.0), 0.0, (0.0, 0.0))


class FlightLoop:
    """The tick of one configuration. Holds only what never changes in flight."""

    def __init__(self, config: FlightConfig) -> None:
        self.config = config
        dt = config.tick_period_us * 1e-6
        lag = config.planner.lag
        self._model = NominalModel(lag, dt)
        self._cascade = Cascade(config.airframe, lag, config.tuning, config.inner, dt)
        self._ticks_per_plan = config.mpc_period_us // config.tick_period_us

    def tick(self, state: FlightState, inputs: TickInputs) -> tuple[FlightState, TickOutputs]:
        """Everything the vehicle does at one instant.

        Args:
            state: What the last tick left.
            inputs: One sensor frame and what arrived since the last tick.

        Returns:
            The state for the next tick and everything this one says.
        """
        now_us = inputs.sensors.t_us
        valid = estimate_state(inputs.sensors)
        estimate = valid or state.estimate
        if estimate is None:
            return replace(state, index=state.index + 1), self._blind(inputs)
        state = replace(
            state,
            estimate=estimate,
            invalid_ticks=0 if valid is not None else state.invalid_ticks + 1,
            stream=merge(state.stream, inputs.targets, now_us),
            safe_set=inputs.safe_set or state.safe_set,
        )
        texts: list[StatusText] = []
        acks: list[CommandAck] = []
        for command in inputs.commands:
            state = self._obey(state, command, estimate, acks, texts)
        state = self._mind_faults(state, estimate, texts)
        state = self._mind_milestones(state, estimate, texts)

        flying = _flies(state)
        request: PlanRequest | None = None
        u = _IDLE_INPUT
        if flying:
            state = self._move_plan(state, inputs)
            motion = self._cascade.motion(state.cascade, estimate)
            if state.index % self._ticks_per_plan == 0:
                targets = self._targets(state, now_us)
                request, plan = ask(
                    self.config, self._model, state.plan, estimate, motion, state.safe_set, targets
                )
                state = replace(state, plan=plan)
            u = plan_input(state.plan, now_us)
        if state.index % self._ticks_per_plan == 0:
            state = self._report_constraints(state, estimate, now_us)
        state, actuators = self._actuate(state, estimate, u, flying)
        snapshot = self._snapshot(state, estimate, u, actuators, flying)
        state = replace(state, index=state.index + 1)
        return state, TickOutputs(actuators, snapshot, request, tuple(acks), tuple(texts))

    # ------------------------------------------------------------ commands and modes

    def _obey(
        self,
        state: FlightState,
        request: CommandRequest,
        estimate: StateEstimate,
        acks: list[CommandAck],
        texts: list[StatusText],
    ) -> FlightState:
        ahead = bool(state.stream) and state.stream[-1].t_us >= estimate.t_us
        decision = decide(
            request, Situation(state.mode, state.landed, state.invalid_ticks == 0, ahead)
        )
        acks.append(
            CommandAck(
                request.command,
                decision.result,
                request.source_system,
                request.source_component,
            )
        )
        if decision.reason:
            texts.append(StatusText(_WARNING, decision.reason))
        if decision.event is None:
            return state
        return self._change_mode(state, decision.event, estimate, texts)

    def _change_mode(
        self, state: FlightState, event: Event, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        mode = next_mode(state.mode, event)
        if mode is None:
            return state
        texts.append(StatusText(_NOTICE, f"{state.mode.value} to {mode.value}: {event.value}"))
        state = self._take_over(state, event, estimate)
        return replace(
            state,
            mode=mode,
            anchor=self._anchor(state, event, estimate),
            anchor_us=estimate.t_us,
            still_since_us=estimate.t_us,
        )

    def _take_over(self, state: FlightState, event: Event, estimate: StateEstimate) -> FlightState:
        """Start the fast loops where the vehicle is, when it begins to move or to fly."""
        if event is Event.ARM:
            standing = self._stands(estimate)
            cascade = at_rest(estimate) if standing else in_hover(self.config.airframe, estimate)
            state = replace(state, landed=standing, cascade=cascade)
        if event in (Event.ARM, Event.TAKE_OFF):
            landed = state.landed and event is not Event.TAKE_OFF
            plan = PlanMemory(
                nominal=nominal_at_rest(estimate),
                since_us=estimate.t_us,
                next_id=state.plan.next_id,
                counters=state.plan.counters,
            )
            return replace(state, landed=landed, plan=plan)
        return state

    def _anchor(self, state: FlightState, event: Event, estimate: StateEstimate) -> Vec3:
        """Where the new mode's own reference begins: the old one's, or the end-effector."""
        continues = event in (Event.CLIMB_DONE, Event.TRAJECTORY_DONE)
        if continues or (_flies(state) and state.mode is not Mode.HOLD and event is Event.LAND):
            return mode_reference(state, self.config.limits, estimate.t_us).p_WE
        return point_in_flight(estimate, self.config.airframe.link_length)[0]

    def _mind_faults(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        plan = state.plan
        flying = _flies(state)
        if not flying and state.invalid_ticks == 0 and not state.failures:
            return state
        faults = detect(
            Evidence(
                flying,
                state.invalid_ticks,
                estimate.R_WB[8],
                estimate.t_us - plan.since_us,
                self.config.mpc_period_us,
                plan.refused,
                state.output_replaced,
            )
        )
        names = tuple(fault.value for fault in faults)
        if names == state.failures:
            return state
        for fault in faults:
            if fault.value not in state.failures:
                response = RESPONSES[fault]
                severity = _EMERGENCY if response is Response.TERMINATE else _WARNING
                texts.append(StatusText(severity, f"{fault.value}: {response.name.lower()}"))
        state = replace(state, failures=names)
        if any(RESPONSES[fault] is Response.TERMINATE for fault in faults):
            return self._change_mode(state, Event.TERMINATE, estimate, texts)
        return state

    def _mind_milestones(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Mode changes the vehicle makes by itself."""
        now_us, limits = estimate.t_us, self.config.limits
        if state.mode is Mode.TAKEOFF:
            seconds = limits.takeoff_climb / limits.climb_speed
            if now_us - state.anchor_us >= seconds * 1e6:
                return self._change_mode(state, Event.CLIMB_DONE, estimate, texts)
        elif state.mode is Mode.TRAJECTORY:
            if not state.stream or state.stream[-1].t_us < now_us:
                return self._change_mode(state, Event.TRAJECTORY_DONE, estimate, texts)
        elif state.mode is Mode.LAND:
            if not self._stands(estimate):
                return replace(state, still_since_us=now_us)
            if now_us - state.still_since_us >= limits.landed_time_us:
                state = replace(state, landed=True)
                return self._change_mode(state, Event.TOUCHED_DOWN, estimate, texts)
        return state

    def _stands(self, estimate: StateEstimate) -> bool:
        """Near standing height and hardly moving."""
        limits, legs = self.config.limits, self.config.airframe.leg_length
        vx, vy, vz = estimate.v_WB
        return (
            -estimate.p_WB[2] < legs + limits.landed_height
            and vx * vx + vy * vy + vz * vz < limits.landed_speed**2
        )

    # ------------------------------------------------------------ plan and actuators

    def _move_plan(self, state: FlightState, inputs: TickInputs) -> FlightState:
        """Bring the plan's state to this tick: a new plan, or one more step of the old."""
        now_us, plan = inputs.sensors.t_us, state.plan
        taken = take_answer(plan, inputs.plan, now_us, self._model, self.config.tick_period_us)
        if taken.running is plan.running and taken.nominal is not None and now_us > plan.since_us:
            last_us = now_us - self.config.tick_period_us
            moved = self._model.step(taken.nominal, plan_input(taken, last_us))
            taken = replace(taken, nominal=moved)
        return replace(state, plan=taken)

    def _targets(self, state: FlightState, now_us: int) -> tuple[EndEffectorTarget, ...]:
        config = self.config
        apply_us = now_us + config.plan_delay_ticks * config.tick_period_us
        return tuple(
            mode_reference(state, config.limits, apply_us + node * config.mpc_period_us)
            for node in range(config.planner.horizon + 1)
        )

    def _actuate(
        self, state: FlightState, estimate: StateEstimate, u: PlanInput, flying: bool
    ) -> tuple[FlightState, ActuatorCommand]:
        airframe, memory = self.config.airframe, state.cascade
        armed = state.mode not in (Mode.DISARMED, Mode.FAULT)
        wanted = STOPPED
        if flying and state.plan.nominal is not None:
            wanted, memory = self._cascade.step(memory, estimate, state.plan.nominal, u)
        elif armed:
            idle = self.config.limits.idle_thrust
            wanted = ActuatorCommand((idle, idle, idle, idle), (0.0, 0.0))
            memory = at_rest(estimate)
        sent, replaced = gate(airframe, wanted, state.cascade.commanded, armed)
        memory = replace(memory, commanded=sent)
        return replace(state, cascade=memory, output_replaced=replaced), sent

    # ------------------------------------------------------------ what is said

    def _report_constraints(
        self, state: FlightState, estimate: StateEstimate, now_us: int
    ) -> FlightState:
        length = self.config.airframe.link_length
        points = (
            (estimate.p_WB, estimate.v_WB),
            point_in_flight(estimate, (length[0], 0.0)),
            point_in_flight(estimate, length),
        )
        target = mode_reference(state, self.config.limits, now_us)
        report = constraint_report(state.safe_set, self._tuning(state), points, target)
        return replace(state, constraints=report)

    def _tuning(self, state: FlightState) -> BarrierTuning:
        planner = self.config.planner
        is_sphere = state.safe_set.kind is ConstraintKind.WORKSPACE
        return planner.workspace if is_sphere else planner.walls

    def _snapshot(
        self,
        state: FlightState,
        estimate: StateEstimate,
        u: PlanInput,
        actuators: ActuatorCommand,
        flying: bool,
    ) -> FlightSnapshot:
        p_WE, v_WE = point_in_flight(estimate, self.config.airframe.link_length)
        plan = state.plan
        nominal = plan.nominal if flying else None
        yaw = nominal.yaw if nominal is not None else estimate.yaw
        reference = mode_reference(state, self.config.limits, estimate.t_us) if flying else None
        return FlightSnapshot(
            estimate.t_us,
            state.mode,
            state.mode not in (Mode.DISARMED, Mode.FAULT),
            estimate,
            p_WE,
            v_WE,
            reference,
            nominal,
            u if flying else None,
            attitude_reference(u.a, yaw),
            actuators,
            plan.running,
            plan.status,
            plan.counters,
            state.constraints,
            state.failures,
        )

    def _blind(self, inputs: TickInputs) -> TickOutputs:
        """Before the first valid sensor frame: nothing moves, everything is refused."""
        sensors = inputs.sensors
        level = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        zero = (0.0, 0.0, 0.0)
        nowhere = StateEstimate(sensors.t_us, zero, zero, level, zero, 0.0, (0.0, 0.0), (0.0, 0.0))
        snapshot = self._snapshot(FlightState(), nowhere, _IDLE_INPUT, STOPPED, flying=False)
        situation = Situation(Mode.DISARMED, landed=True, estimate_valid=False, targets_ahead=False)
        acks, texts = [], []
        for command in inputs.commands:
            decision = decide(command, situation)
            acks.append(
                CommandAck(
                    command.command,
                    decision.result,
                    command.source_system,
                    command.source_component,
                )
            )
            if decision.reason:
                texts.append(StatusText(_WARNING, decision.reason))
        return TickOutputs(STOPPED, snapshot, None, tuple(acks), tuple(texts))


def _flies(state: FlightState) -> bool:
    return state.mode not in (Mode.DISARMED, Mode.FAULT) and not state.landed
