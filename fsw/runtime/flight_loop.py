"""One tick of the flight software, top to bottom: (state, inputs) -> (state, outputs).

No clock, socket, thread or random number: real time, lockstep, replay and tests all call
this. ``FlightLoop.tick`` reads in the order things happen.
"""

from __future__ import annotations

from dataclasses import replace

from fsw.barriers.margins import constraint_report
from fsw.control.braking import Brake
from fsw.control.cascade import Cascade, CascadeMemory, at_rest, in_hover
from fsw.estimation.dead_reckoning import moved_on
from fsw.estimation.estimator import estimate_state
from fsw.model.kinematics import point_in_flight
from fsw.model.nominal import REST_INPUT, NominalModel
from fsw.mpc.reference import merge
from fsw.parameters.consistency import Finding, analyse, loop_tube, refusals, warnings
from fsw.parameters.flight_config import FlightConfig
from fsw.runtime.flight_state import FlightState, MissionMemory, PlanMemory
from fsw.runtime.mission_keeper import received, with_mission
from fsw.runtime.mode_keeper import ModeKeeper, answer
from fsw.runtime.mode_reference import mode_reference
from fsw.runtime.planning import (
    ask,
    late_start,
    measured_state,
    nominal_at_rest,
    plan_input,
    take_answer,
)
from fsw.runtime.steering_keeper import SteeringKeeper
from fsw.signals import (
    STOPPED,
    ActuatorCommand,
    BatteryState,
    CommandAck,
    ConstraintKind,
    ConstraintReport,
    EndEffectorTarget,
    FlightSnapshot,
    Mode,
    OffboardReport,
    Plan,
    PlanFailure,
    PlanInput,
    PlanRequest,
    PredictionState,
    SafeSet,
    SensorFrame,
    Severity,
    StateEstimate,
    StatusText,
    TickInputs,
    TickOutputs,
    Vec2,
    Vec3,
)
from fsw.vehicle.battery import drained
from fsw.vehicle.confine import contradictions
from fsw.vehicle.safety_gate import gate
from fsw.vehicle.situation import Situation
from fsw.vehicle.tame import tamed

_STILL = SensorFrame(
    1_000_000,
    (0.0, 0.0, -1.0),
    (0.0, 0.0, 0.0),
    (1.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0),
    (0.0, 0.0, -9.81),
    (0.0, 0.0),
    (0.0, 0.0),
)
_FROM_OUTSIDE = (Mode.TRAJECTORY, Mode.MISSION)  # modes whose targets somebody else made
# N m s/rad, about critical for the hanging arm: it is let down beside walls as well.
_ARM_DAMPING: Vec2 = (0.15, 0.04)


class FlightLoop:
    """The tick of one configuration; holds only what never changes in flight."""

    def __init__(self, config: FlightConfig) -> None:
        self.config = config
        dt = config.tick_period_us * 1e-6
        self._model = NominalModel(config.airframe, dt)
        self._brake = Brake(config.airframe, config.planner.limits.tilt)
        self._cascade = Cascade(config.airframe, config.tuning, config.inner, dt)
        self._modes = ModeKeeper(config)
        self._steering = SteeringKeeper(config)
        self._loop_tube = loop_tube(config)
        self._ticks_per_plan = config.mpc_period_us // config.tick_period_us

    def warm_up(self) -> None:
        """Compile every kernel of the tick, before anything flies."""
        estimate = estimate_state(_STILL)
        assert estimate is not None
        nominal = self._model.step(nominal_at_rest(estimate), REST_INPUT)
        self._cascade.step(in_hover(self.config.airframe, estimate), estimate, nominal, REST_INPUT)

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
        if valid is not None and inputs.stale_us:
            valid = moved_on(valid, 1e-6 * inputs.stale_us)
        estimate = valid or state.estimate
        texts: list[StatusText] = []
        if inputs.targets or inputs.safe_set is not None or inputs.mission is not None:
            mission = self._receive(state, inputs, now_us, texts)
            state = replace(state, mission=mission)
            if inputs.mission is not None:
                state = with_mission(state, inputs.mission, self.config, now_us)
        state = self._hear(state, inputs)
        if estimate is None:
            return state, _blind(inputs, texts)
        state = _count_invalid(state, valid)
        acks: list[CommandAck] = []
        if inputs.commands:
            state, acks = self._modes.obey(state, estimate, inputs.commands, texts)
        state = self._modes.mind_faults(state, estimate, texts)
        state = self._modes.mind_milestones(state, estimate, texts)

        ticks = self._elapsed_ticks(state, now_us)
        index, per_plan = state.index + ticks, self._ticks_per_plan
        planning_due = index // per_plan != state.index // per_plan
        nominal, plan, u = self._follow_plan(state, inputs.plan, now_us, ticks)
        request, constraints, reference = None, state.constraints, state.reference
        arming_refusal, battery = state.arming_refusal, state.battery
        if planning_due:
            if state.vehicle.flies and nominal is not None:
                state, request, plan = self._ask(state, estimate, nominal, plan, now_us)
            target = self._reference(state, now_us)
            constraints = self._constraints(state, estimate, target)
            reference = target if state.vehicle.flies else None
            arming_refusal = self._modes.arming_refusal(state, estimate)
            battery = self._battery(state)
        sent, memory, replaced = self._actuate(state, estimate, nominal, u, ticks)
        state = FlightState(
            index,
            now_us,
            estimate,
            state.invalid_ticks,
            nominal,
            replaced,
            memory,
            state.vehicle,
            state.mission,
            plan,
            constraints,
            reference,
            state.tuning,
            state.steer,
            state.offboard,
            battery,
            arming_refusal,
        )
        report = self._steering.report(state, now_us)
        snapshot = _snapshot(state, estimate, u, report, inputs.sensors.accel_B)
        return state, TickOutputs(sent, snapshot, request, tuple(acks), tuple(texts))

    def judge(self, safe_set: SafeSet) -> tuple[Finding, ...]:
        """What speaks for and against keeping a safe set with this configuration."""
        return analyse(self.config, safe_set, self._loop_tube)

    def _elapsed_ticks(self, state: FlightState, now_us: int) -> int:
        """Ticks since the last one: more than one where sensor frames were missed."""
        elapsed = (now_us - state.t_us) // self.config.tick_period_us
        return min(max(elapsed, 1), self.config.catch_up_ticks) if state.index >= 0 else 1

    def _follow_plan(
        self, state: FlightState, answer: Plan | PlanFailure | None, now_us: int, ticks: int
    ) -> tuple[PredictionState | None, PlanMemory, PlanInput]:
        """Bring the plan's state to this tick, by a new plan or one more step."""
        nominal = state.nominal
        if not state.vehicle.flies or nominal is None:
            return nominal, state.plan, REST_INPUT
        tick_us, running = self.config.tick_period_us, state.plan.running
        plan, new_plan = take_answer(state.plan, answer, now_us)
        if new_plan is not None:
            nominal = late_start(self._model, new_plan, now_us, tick_us)
        elif now_us > plan.since_us:
            for ago in range(ticks, 0, -1):
                u = plan_input(running, nominal, now_us - ago * tick_us, self._brake)
                nominal = self._model.step(nominal, u)
        return nominal, plan, plan_input(plan.running, nominal, now_us, self._brake)

    def _receive(
        self,
        state: FlightState,
        inputs: TickInputs,
        now_us: int,
        texts: list[StatusText],
    ) -> MissionMemory:
        """Take in targets and a safe set; a new safe set is analysed before it is believed."""
        stream = merge(state.mission.stream, inputs.targets, now_us)
        mission = replace(state.mission, stream=stream)
        wanted = received(mission, inputs.mission, inputs.safe_set)
        if wanted.safe_set == mission.safe_set:
            return wanted
        if wanted.safe_set == mission.refused_set:
            return replace(mission, rally=wanted.rally)
        findings = self.judge(wanted.safe_set)
        against = (*contradictions(wanted.safe_set), *refusals(findings))
        texts += [StatusText(Severity.WARNING, text) for text in against]
        texts += [StatusText(Severity.INFO, text) for text in warnings(findings)]
        if against and not self.config.soft and state.vehicle.flies:
            texts.append(StatusText(Severity.WARNING, "safe set refused: the old one is kept"))
            return replace(mission, rally=wanted.rally, refused_set=wanted.safe_set)
        return replace(wanted, refused_set=None, refusals=() if self.config.soft else against)

    def _hear(self, state: FlightState, inputs: TickInputs) -> FlightState:
        """Note set-points for now and signs of life of a ground station."""
        if inputs.ground_station_heard:
            vehicle = replace(state.vehicle, station_us=inputs.sensors.t_us)
            state = replace(state, vehicle=vehicle)
        heard = (inputs.motion, inputs.attitude, inputs.joints) != (None, None, None)
        if heard or inputs.refused_setpoints:
            state = replace(state, offboard=self._steering.receive(state.offboard, inputs))
        return state

    def _battery(self, state: FlightState) -> BatteryState:
        thrust = state.cascade.commanded.rotor_thrust
        period = 1e-6 * self.config.mpc_period_us
        limits = self.config.limits
        levels = (limits.battery_low, limits.battery_critical, limits.battery_emergency)
        return drained(self.config.battery, levels, state.battery, thrust, period)

    def _ask(
        self,
        state: FlightState,
        estimate: StateEstimate,
        nominal: PredictionState,
        plan: PlanMemory,
        now_us: int,
    ) -> tuple[FlightState, PlanRequest, PlanMemory]:
        config = self.config
        apply_us = now_us + config.plan_delay_ticks * config.tick_period_us
        steered = self._steering.plan_ahead(state, estimate, apply_us)
        if steered is not None:
            state, targets, joint_targets = steered
        else:
            joint_targets = ()
            targets = tuple(
                self._reference(state, apply_us + node * config.mpc_period_us)
                for node in range(config.planner.horizon + 1)
            )
        if steered is not None or state.vehicle.mode in _FROM_OUTSIDE:
            p_WE, v_WE = point_in_flight(estimate, config.airframe.link_length)
            walls, safe_set = config.planner.walls, state.mission.safe_set
            targets = tamed(targets, p_WE, v_WE, safe_set, walls.alpha, walls.slope)
        measured = measured_state(estimate, self._cascade.motion(state.cascade, estimate))
        request, plan = ask(
            config,
            self._model,
            self._brake,
            plan,
            nominal,
            measured,
            state.mission.safe_set,
            targets,
            joint_targets,
            now_us,
        )
        return state, request, plan

    def _actuate(
        self,
        state: FlightState,
        estimate: StateEstimate,
        nominal: PredictionState | None,
        u: PlanInput,
        ticks: int,
    ) -> tuple[ActuatorCommand, CascadeMemory, bool]:
        """Close the loops, idle or stay still, and let the safety gate have the last word."""
        memory, wanted = state.cascade, STOPPED
        if state.vehicle.flies and nominal is not None:
            wanted, memory = self._cascade.step(memory, estimate, nominal, u, ticks)
        elif state.vehicle.armed:
            idle = self.config.limits.idle_thrust
            wanted = ActuatorCommand((idle, idle, idle, idle), _let_down(estimate))
            memory = at_rest(self.config.airframe, estimate)
        sent, replaced = gate(
            self.config.airframe, wanted, state.cascade.commanded, state.vehicle.armed
        )
        if replaced:
            # What made the wish no number is in the loops' new memory too: forget it.
            memory = state.cascade
        return sent, memory.after_sending(sent), replaced

    def _constraints(
        self, state: FlightState, estimate: StateEstimate, target: EndEffectorTarget
    ) -> ConstraintReport:
        length, planner = self.config.airframe.link_length, self.config.planner
        points = (
            (estimate.p_WB, estimate.v_WB),
            point_in_flight(estimate, (length[0], 0.0)),
            point_in_flight(estimate, length),
        )
        safe_set = state.mission.safe_set
        in_sphere = safe_set.kind is ConstraintKind.WORKSPACE
        tuning = planner.workspace if in_sphere else planner.walls
        return constraint_report(safe_set, tuning, points, target)

    def _reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        steered = self._steering.target(state, t_us)
        if steered is not None:
            return steered
        return mode_reference(state.vehicle, state.mission, self.config.limits, t_us)


def _let_down(estimate: StateEstimate) -> Vec2:
    """Joint torques that let a folded arm hang without swinging through."""
    (rate1, rate2), (damping1, damping2) = estimate.qd_arm, _ARM_DAMPING
    return -damping1 * rate1, -damping2 * rate2


def _count_invalid(state: FlightState, valid: StateEstimate | None) -> FlightState:
    if valid is None:
        return replace(state, invalid_ticks=state.invalid_ticks + 1)
    return replace(state, invalid_ticks=0) if state.invalid_ticks else state


def _snapshot(
    state: FlightState,
    estimate: StateEstimate,
    u: PlanInput,
    offboard: OffboardReport,
    accel_B: Vec3,
) -> FlightSnapshot:
    vehicle, plan, steer = state.vehicle, state.plan, state.steer.aim
    flies = vehicle.flies and state.nominal is not None
    return FlightSnapshot(
        estimate.t_us,
        vehicle.mode,
        vehicle.armed,
        estimate,
        state.reference,
        state.nominal if flies else None,
        u if flies else None,
        state.cascade.commanded,
        plan.running,
        plan.status,
        plan.counters,
        state.constraints,
        vehicle.failures,
        vehicle.landed,
        vehicle.home,
        state.battery,
        state.arming_refusal,
        offboard,
        vehicle.standby,
        state.mission.flight.progress,
        vehicle.failsafe_from,
        steer.orbit if vehicle.mode is Mode.ORBIT and steer is not None else None,
        accel_B,
    )


def _blind(inputs: TickInputs, texts: list[StatusText]) -> TickOutputs:
    """Before the first valid sensor frame: nothing moves, and commands are refused."""
    zero = (0.0, 0.0, 0.0)
    level = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    nowhere = StateEstimate(
        inputs.sensors.t_us, zero, zero, level, zero, 0.0, (0.0, 0.0), (0.0, 0.0)
    )
    empty = FlightState()
    snapshot = FlightSnapshot(
        t_us=inputs.sensors.t_us,
        mode=Mode.DISARMED,
        armed=False,
        estimate=nowhere,
        reference=None,
        plan_state=None,
        plan_input=None,
        actuators=STOPPED,
        plan=None,
        plan_status=empty.plan.status,
        counters=empty.plan.counters,
        constraints=empty.constraints,
    )
    situation = Situation(Mode.DISARMED, landed=True, estimate_valid=False, targets_ahead=False)
    acks = [answer(command, situation, texts)[0] for command in inputs.commands]
    return TickOutputs(STOPPED, snapshot, None, tuple(acks), tuple(texts))
