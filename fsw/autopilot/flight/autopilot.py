"""One tick of the flight software, top to bottom: (state, inputs) -> (state, outputs).

No clock, socket, thread or random number: real time, lockstep, replay and tests all call this.
``control`` and ``conclude`` read in the order things happen.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fsw.autopilot.control.actuator_watch import pause
from fsw.autopilot.control.cascade import at_rest, in_hover
from fsw.autopilot.control.joints import arm_damping
from fsw.autopilot.control.safety_gate import gate, stopped
from fsw.autopilot.control.tube import beyond_covered
from fsw.autopilot.estimation.estimator import estimate_state
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.flight.calm_tick import CalmTick
from fsw.autopilot.flight.commander import Commander
from fsw.autopilot.flight.commands.circle_room import circle_too_close
from fsw.autopilot.flight.estimate.before_estimate import nothing_known, nowhere, told
from fsw.autopilot.flight.estimate.exact_state import ExactState
from fsw.autopilot.flight.estimate.jump import all_along
from fsw.autopilot.flight.estimate.sensed_state import CaughtUp, SensedState
from fsw.autopilot.flight.fast_loop import FastLoop, loops_of
from fsw.autopilot.flight.land_detector import is_aloft, with_range
from fsw.autopilot.flight.modes.descend import Descent, forget_wind
from fsw.autopilot.flight.modes.mission import with_update
from fsw.autopilot.flight.modes.offboard import accept_setpoints
from fsw.autopilot.flight.plan_exchange import (
    PlanExchange,
    measured_state,
    nominal_at_rest,
    requested,
    resumed,
    with_plan_state,
)
from fsw.autopilot.flight.restart import restarted
from fsw.autopilot.flight.safety.accuracy_watch import AccuracyMemory, AccuracyWatch
from fsw.autopilot.flight.safety.damage_watch import DamageWatch
from fsw.autopilot.flight.safety.progress_watch import see_progress
from fsw.autopilot.flight.safety.retreat import retreat_place
from fsw.autopilot.flight.safety.safe_set import SafeSetCheck
from fsw.autopilot.flight.safety.safety_watch import SafetyWatch
from fsw.autopilot.flight.safety.uncertain_clearance import (
    InflatedSafeSet,
    UncertainClearance,
    pose_covariance,
)
from fsw.autopilot.flight.safety.zone_room import ZoneRoom
from fsw.autopilot.flight.setpoints.reference_horizon import ReferenceHorizon, pressed_reference
from fsw.autopilot.flight.setpoints.target_check import TargetCheck
from fsw.autopilot.flight.snapshot import Shown
from fsw.autopilot.flight.state import AIDED, Damage, FlightState, PlanMemory, SafetyMemory
from fsw.autopilot.geometry.rotation import wrap_angle
from fsw.autopilot.measurements import RangeSample, Sensor
from fsw.autopilot.model.actuator_health import SOUND
from fsw.autopilot.model.battery import corrected, drained
from fsw.autopilot.model.body import hull_reach
from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.model.nominal import rest_input
from fsw.autopilot.model.rotors import is_light
from fsw.autopilot.mpc.reference import merge
from fsw.autopilot.parameters.consistency import Finding
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.shapes.zones import NO_ZONES, Array, moving_zones
from fsw.autopilot.signals import (
    ActuatorCommand,
    CommandAck,
    ConstraintKind,
    EndEffectorTarget,
    JointVector,
    Mode,
    Plan,
    PlanFailure,
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
)
from fsw.autopilot.tick_record import BREACH, FILTER_ACTED, GATE_NEEDED, OFF_PLAN, Tick
from fsw.frozen import replace

_STILL = SensorFrame(
    t_us=1_000_000,
    p_WB=(0.0, 0.0, -1.0),
    v_WB=(0.0, 0.0, 0.0),
    q_WB=(1.0, 0.0, 0.0, 0.0),
    gyro_B=(0.0, 0.0, 0.0),
    accel_B=(0.0, 0.0, -9.81),
    q_arm=(),
    qd_arm=(),
)
# A name of the module is looked up ten times faster than a member of an enumeration.
_DESCEND = Mode.DESCEND


class Controlled(NamedTuple):
    """A tick whose command is decided; ``Autopilot.conclude`` does the rest."""

    outputs: TickOutputs  # so far
    inputs: TickInputs
    state: FlightState  # with what was received, commanded and decided
    memory: Tick  # for the next tick
    estimate: StateEstimate | None = None  # None: there has been none yet, or it is calm
    fusion: FusionMemory | None = None
    flown: bool = False  # the loops are closed
    plan: PlanMemory = PlanMemory()
    ticks: int = 1  # since the last one
    replaced: bool = False  # the command, by the safety gate
    caught: CaughtUp | None = None  # what else is known, where that had to be known at once
    calm: bool = False  # nothing happened; ``memory`` and ``fusion`` are all that is new


class Autopilot:
    """The tick of one configuration; holds that, and caches that change no result."""

    def __init__(self, config: FlightConfig) -> None:
        self.config = config
        nothing: EndEffectorTarget | None = None
        self._zones = InflatedSafeSet(), nothing, NO_ZONES
        self._safe_sets = SafeSetCheck(config)
        self._targets = TargetCheck(config, self._safe_sets.loop_tube)
        self._commander = Commander(config)
        self._horizon = ReferenceHorizon(config)
        self._plans = PlanExchange(config)
        self._watch = SafetyWatch(config, self._safe_sets.loop_tube)
        self._cascade = loops_of(config)
        self._fast = FastLoop(self._cascade, self._plans.model, config.estimator)
        self._sensed = SensedState(config.estimator, self._fast)
        self._exact = ExactState(self._fast)
        self._descent = Descent(config)
        self._damage = DamageWatch(config)
        self._watches = bool(config.limits.watches_actuators)
        self.calm = CalmTick(
            *(config, self._fast, self._damage, self._watch, self._sensed, self.zones_now)
        )
        self._accuracy = AccuracyWatch(config, self._safe_sets.loop_tube)
        self._clearance = UncertainClearance(config, self._cascade.law.filter.lag)
        self._room = ZoneRoom(config)
        limits = config.limits
        low, critical = limits.battery_low, limits.battery_critical
        self._battery_levels = low, critical, limits.battery_emergency
        self._tick_us = config.tick_period_us
        self._damping = arm_damping(config.airframe)
        self._ticks_per_plan = config.ticks_per_plan
        self._max_us = config.catch_up_ticks * config.tick_period_us

    def warm_up(self) -> None:
        """Compile every kernel of the tick, before anything flies."""
        rest = (0.0,) * self.config.airframe.bodies.joints
        estimate = estimate_state(replace(_STILL, q_arm=rest, qd_arm=rest))
        assert estimate is not None
        r = with_plan_state(in_hover(self.config.airframe, estimate), nominal_at_rest(estimate))
        self._plans.model.move(r, 1)
        self._fast.step(r)
        self._safe_sets.warm_up(estimate)
        self._horizon.warm_up(estimate)
        self._sensed.warm_up()
        self._clearance.warm_up(estimate)
        end_effector(self.config.airframe.bodies, estimate)
        retreat_place(self.config, SafeSet(()), estimate, 0.0)
        hull_reach(self.config.body, (0.0, 0.0, 1.0))
        circle_too_close(estimate.p_WB, 1.0, SafeSet(()), self.config.body, estimate.t_us)

    def analyse(self, safe_set: SafeSet) -> tuple[Finding, ...]:
        """Findings on whether this configuration can keep a safe set."""
        return self._safe_sets.analyse(safe_set)

    def tick(self, state: FlightState, inputs: TickInputs) -> tuple[FlightState, TickOutputs]:
        """Everything the vehicle does at one instant: the next state, and everything it says."""
        return self.conclude(self.control(state, inputs))

    def control(self, state: FlightState, inputs: TickInputs) -> Controlled:
        """The part of a tick that the vehicle waits for: from the sensors to the actuators."""
        calm = self.calm.fly(state, inputs)
        if calm is not None:
            r, fusion = calm
            outputs = self._commanded(state, r, r.actuator_command, flown=True)
            return Controlled(outputs, inputs, state, r, None, fusion, True, state.plan, calm=True)
        now_us = inputs.sensors.t_us
        texts: list[StatusText] = []
        if state.vehicle.restarts:
            state = restarted(state, self.config.airframe)
        # Ranges are looked for in all that was received, those of missed ticks included.
        as_received = inputs
        if state.index >= 0 and inputs.samples:
            state, inputs = self._sensed.take_missed(state, inputs)
        state, r, estimate, fusion, caught = self._estimate(state, inputs, texts)
        began = state.record
        state = self._receive(state, as_received, texts)
        if estimate is None:
            return self._blind(state, r, inputs, texts)._replace(fusion=fusion, caught=caught)

        acks: list[CommandAck] = []
        if inputs.commands:
            state, acks = self._commander.handle_commands(state, estimate, inputs.commands, texts)
        state = self._note_tilt_load_and_jump(state, estimate)
        state = self._commander.check_failsafes(state, estimate, texts)
        state = self._commander.check_mode_completion(state, estimate, texts)

        ticks = looped = self._elapsed_ticks(state, now_us)
        vehicle = state.vehicle
        flown = vehicle.flies and vehicle.unloaded is None and bool(state.record.has_plan)
        if flown and now_us - state.t_us > self._max_us:  # on to the next that asks for a plan
            ticks, looped = self._ticks_per_plan - state.index % self._ticks_per_plan, 1
            motion = self._cascade.motion(state.record, estimate)
            state = resumed(self.config, state, estimate, motion)
        if state.record is not began:  # loops or plan begin anew
            r = state.record.copy()
            r.state_estimate = estimate
        plan = state.plan
        if flown:
            plan = self._follow(state, r, estimate, inputs.plan, looped)
        else:
            r.plan_input = rest_input(r.joint_count)
        sent, r, replaced = self._actuate(state, r, estimate, looped, flown=flown)
        outputs = self._commanded(state, r, sent, flown=flown)
        outputs = replace(outputs, acks=tuple(acks), texts=tuple(texts))
        return Controlled(
            outputs, inputs, state, r, estimate, fusion, flown, plan, ticks, replaced, caught
        )

    def _commanded(
        self, state: FlightState, r: Tick, sent: ActuatorCommand, *, flown: bool
    ) -> TickOutputs:
        """What a tick commands: rotors and joints, gripper, and another autopilot's setpoint."""
        asked, v = self._cascade.setpoint(r) if flown else None, state.vehicle
        return TickOutputs(sent, v.mode, v.armed, asked, v.gripper)

    def _estimate(
        self, state: FlightState, inputs: TickInputs, texts: list[StatusText]
    ) -> tuple[FlightState, Tick, StateEstimate | None, FusionMemory | None, CaughtUp | None]:
        """The record of this tick, with its estimate or the last one, and the estimator's part."""
        if not inputs.samples and state.fusion is None:
            state, r = self._exact.estimate(state, inputs, texts)
            return state, r, r.state_estimate, None, None
        state, fusion, estimate, caught = self._sensed.estimate(state, inputs)
        r = state.record.copy()
        if estimate is not None:
            r.state_estimate = estimate
        return state, r, estimate, fusion, caught

    def conclude(self, controlled: Controlled) -> tuple[FlightState, TickOutputs]:
        """The rest of the tick, for which the actuators need not wait.

        What it finds out is acted upon in the next tick.
        """
        # All fields, in their order: eight of them by name would take 0.15 us longer.
        outputs, inputs, state, r, before, fusion, flown, plan, ticks, replaced, known, calm = (
            controlled
        )
        texts, safety, reset, estimate = outputs.texts, state.safety, None, before
        flags = r.flags if flown and not calm else 0  # a calm tick has none
        if estimate is not None and (flags & OFF_PLAN or safety.off_plan_us >= 0):
            safety = self._watch.off_plan(
                safety,
                estimate,
                r.plan_state if flown else None,
                state.accuracy.reach,
                max(self._wind_room(r)),
            )
        if fusion is not None and not (calm and self._sensed.rests(state, fusion, inputs)):
            estimate = r.state_estimate if calm else estimate
            caught = known or self._sensed.catch_up(state, fusion, estimate, inputs)
            fusion, found, reset, said = caught
            texts = (*texts, *said) if said else texts
            if reset is not None:
                r, state, plan = all_along(r, state, plan, reset)
            if found is not None and found is not estimate:
                r.state_estimate = found
            estimate = found
        if calm and texts is outputs.texts and reset is None:  # all that is left to do is little
            damage = state.damage if fusion is None else self._see_damage(state, r, controlled)
            state = self.calm.after(state, r, fusion)
            if damage is not state.damage:
                state = replace(state, damage=damage)
            return state, replace(outputs, shown=Shown(state, inputs.sensors))
        if estimate is None or (before is None and not calm):
            # Ticks are counted from the first estimate on; what looks now and then goes by time.
            t_us = inputs.sensors.t_us
            unknown = nothing_known(outputs, state, t_us, texts)
            return replace(state, t_us=t_us, fusion=fusion), unknown
        now_us, per_plan = inputs.sensors.t_us, self._ticks_per_plan
        index = state.index + ticks
        request = None
        if index // per_plan != state.index // per_plan:
            nominal = r.plan_state if flown else None
            state = replace(state, plan=plan, safety=safety, fusion=fusion)
            state, request, news = self._each_period(state, estimate, nominal, now_us)
            plan, safety, texts = state.plan, state.safety, (*texts, *news)
        state = replace(
            state,
            index=index,
            t_us=now_us,
            output_replaced=replaced,
            record=r,
            plan=plan,
            safety=self._filtered(state, safety, estimate, r.margin, flags),
            fusion=fusion,
            damage=self._see_damage(state, r, controlled),
        )
        shown = Shown(state, inputs.sensors)
        return state, replace(outputs, shown=shown, plan_request=request, texts=texts)

    def _each_period(
        self,
        state: FlightState,
        estimate: StateEstimate,
        nominal: PredictionState | None,
        now_us: int,
    ) -> tuple[FlightState, PlanRequest | None, list[StatusText]]:
        """What is looked at once a planning period, and the request for a plan of what is flown.

        The record of the ``state`` is that of the tick before.
        """
        mission, request = state.mission, None
        held = self._safe_sets.hold_silent_zones(mission, now_us)
        if held is not mission:
            state = replace(state, mission=held)
        covariance = self._sensed.covariance(state.fusion)
        pose = self._pose_error(state, estimate, covariance)
        state = self._keep_clear(state, estimate, pose)
        texts: list[StatusText] = []
        if nominal is not None:
            state, request = self._request_plan(state, estimate, nominal, now_us, texts)
        state = self._report_slowly(state, estimate, now_us)
        state = self._sensed.reported(state, estimate, covariance)
        state = self._see_accuracy(state, estimate, covariance, pose, texts)
        announced, safety = len(state.mission.announced.zones), state.safety
        flies = nominal is not None
        safety = self._watch.breach(safety, estimate, state.constraints, announced, flies=flies)
        return replace(state, safety=safety), request, texts

    def _blind(
        self, state: FlightState, r: Tick, inputs: TickInputs, texts: list[StatusText]
    ) -> Controlled:
        """Before the first estimate: actuators off, and no command that needs one."""
        state, acks = self._commander.handle_commands(
            state, nowhere(inputs.sensors.t_us, r.joint_count), inputs.commands, texts, known=False
        )
        texts += told(state, self._tick_us)
        still = stopped(self.config.airframe)
        outputs = TickOutputs(still, Mode.DISARMED, False, acks=tuple(acks), texts=tuple(texts))
        return Controlled(outputs, inputs, state, r)

    def _note_tilt_load_and_jump(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """What the failsafe table looks at and what is not kept up to date elsewhere.

        A tilt with no way back, rotors that carry too little, time that jumped.
        """
        safety, watch = state.safety, self._watch
        tilted = safety.rolled_us >= 0 or safety.pitched_us >= 0
        if tilted or not estimate.R_WB[8] > watch.upright:
            safety = watch.attitude(safety, estimate, flies=state.vehicle.flies)
        closed = state.vehicle.flies and state.vehicle.unloaded is None
        light = closed and is_light(self.config.airframe, state.record.rotors)
        if light or safety.light_us >= 0:
            safety = watch.carried(safety, estimate.t_us, light=light)
        if self._jumped(state, estimate.t_us):
            safety = watch.jumped(safety, estimate.t_us, estimate.t_us - state.t_us)
        return state if safety is state.safety else replace(state, safety=safety)

    def _follow(
        self,
        state: FlightState,
        r: Tick,
        estimate: StateEstimate,
        answer: Plan | PlanFailure | None,
        ticks: int,
    ) -> PlanMemory:
        """Write the plan's state now; in Descend it is none of a plan, though plans are asked for.

        Reads plan; writes plan, u.
        """
        plan = self._plans.follow(state.plan, r, answer, estimate.t_us, ticks)
        before = state.plan_state if state.vehicle.mode is _DESCEND else None
        if before is not None:
            goal = state.setpoint.goal
            place = None if goal is None else goal.motion.p
            moved = self._descent.step(before, estimate, state.aiding, ticks, place)
            r.plan_state, r.plan_input = moved
            if self._descent.stays_level(state.aiding):
                forget_wind(r.observed, estimate)
        if state.damage.joint:
            freeze_arm(r, estimate, state.damage.report.joints)
        return plan

    def _filtered(
        self,
        state: FlightState,
        safety: SafetyMemory,
        estimate: StateEstimate,
        margin: float,
        flags: int,
    ) -> SafetyMemory:
        """The memory with what the safety filter has done, and the negative ``margin`` [m] seen."""
        if flags & FILTER_ACTED or safety.filter_us >= 0:
            pushed = bool(flags & FILTER_ACTED)
            safety = self._watch.filtered(safety, estimate.t_us, pushed=pushed)
        if not flags & BREACH:
            return safety
        report = self._safe_sets.margins(state.kept, estimate, state.reference)
        announced = len(state.mission.announced.zones)
        return self._watch.breach(safety, estimate, report, announced, flies=True, seen=margin)

    def _receive(
        self, state: FlightState, inputs: TickInputs, texts: list[StatusText]
    ) -> FlightState:
        """Store received targets, safe set, mission, setpoints and ground station heartbeat."""
        now_us = inputs.sensors.t_us
        if inputs.targets or inputs.announced or inputs.mission is not None or inputs.refused:
            state = self._store_uploads(state, inputs, texts)
        ranges = [one for one in inputs.samples if type(one) is RangeSample]
        if ranges:
            state = replace(state, vehicle=with_range(state.vehicle, ranges[-1]))
        if inputs.battery is not None:
            cells, levels = self.config.airframe.battery, self._battery_levels
            battery = corrected(cells, levels, state.battery, inputs.battery)
            state = replace(state, battery=battery)
        if inputs.host is not None:
            state = replace(state, host=inputs.host)
        if inputs.sensor_clock_jump_us:
            safety = self._watch.jumped(state.safety, now_us, inputs.sensor_clock_jump_us)
            state = replace(state, safety=safety)
        if inputs.ground_station_heard:
            state = replace(state, vehicle=replace(state.vehicle, gcs_heard_us=now_us))
        unheard = inputs.motion is None and inputs.attitude is None and inputs.joints is None
        if not unheard or inputs.refused_setpoints:
            offboard = accept_setpoints(state, inputs, self.config, texts)
            state = replace(state, offboard=offboard)
        return state

    def _store_uploads(
        self, state: FlightState, inputs: TickInputs, texts: list[StatusText]
    ) -> FlightState:
        """Store targets, safe set and mission, as far as they are within bounds."""
        now_us, mission, update = inputs.sensors.t_us, state.mission, inputs.mission
        v, target, news = state.vehicle, state.reference, list[StatusText]()
        if target is None and v.flies and state.estimate is not None:
            mode = self._commander.mode(state)
            target = self._horizon.target(mode, state, state.estimate, now_us)
        mission = self._safe_sets.update(
            mission, inputs, state.estimate, news, flies=v.flies, armed=v.armed, target=target
        )
        believed, refused = self._targets.believed(inputs.targets, mission.safe_set, now_us)
        against = (*refused, *inputs.refused)
        texts += [StatusText(Severity.CRITICAL, text) for text in dict.fromkeys(against)] + news
        stream = merge(mission.stream, believed, now_us)
        refused_count = mission.refused_count + len(against)
        mission = replace(mission, stream=stream, refused_count=refused_count)
        if mission.refused_count != state.mission.refused_count:
            counters = replace(state.safety.counters, refusals=mission.refused_count)
            state = replace(state, safety=replace(state.safety, counters=counters))
        state = replace(state, mission=mission)
        if mission.safe_set is not state.kept.source:
            state = replace(state, kept=state.kept.of(mission.safe_set))
            if state.estimate is not None:
                state = self._with_room(state, state.estimate)
        if update is not None and mission.upload_taken:
            state = with_update(state, update, self.config, now_us)
        return state

    def _jumped(self, state: FlightState, now_us: int) -> bool:
        """Whether time did: on by more than is made up for, or not on at all."""
        return state.index >= 0 and not 0 < now_us - state.t_us <= self._max_us

    def _elapsed_ticks(self, state: FlightState, now_us: int) -> int:
        """Ticks since the last one: more than one where sensor frames were missed."""
        elapsed = (now_us - state.t_us) // self._tick_us
        if elapsed == 1 or state.index < 0:
            return 1
        return min(max(elapsed, 1), self.config.catch_up_ticks)

    def _request_plan(
        self,
        state: FlightState,
        estimate: StateEstimate,
        nominal: PredictionState,
        now_us: int,
        texts: list[StatusText],
    ) -> tuple[FlightState, PlanRequest]:
        """Request a plan that takes effect after a fixed delay; to replan, from the measurement.

        Appends status texts on its reference.
        """
        config = self.config
        apply_us = now_us + config.plan_delay_ticks * config.tick_period_us
        mode, limited = self._commander.mode(state), state.limited
        state, (targets, joints) = self._horizon(mode, state, estimate, apply_us)
        if state.limited and state.limited != limited:
            texts.append(StatusText(Severity.WARNING, f"reference limited: {state.limited}"))
        asked = self._horizon.asked(mode, state, estimate, apply_us)
        progress = see_progress(
            *(state.progress, asked, config.body, state.kept.safe_set, estimate, texts)
        )
        p_WE, _ = end_effector(config.airframe.bodies, estimate)
        targets, pushes = pressed_reference(targets, state.record, p_WE, config.tuning.press)
        plan, safety = state.plan, state.safety
        measured = measured_state(estimate, self._cascade.motion(state.record, estimate))
        start, from_nominal = self._plans.start(plan, nominal, measured, now_us, safety.replan)
        request = PlanRequest(
            plan_id=plan.next_id,
            t_apply_us=apply_us,
            start=start,
            targets=targets,
            safe_set=state.kept.safe_set,
            from_nominal=from_nominal,
            joint_targets=joints,
            recent_disturbance=state.record.observed.recent,
            mode=state.vehicle.mode,
            pushes=pushes,
        )
        if safety.replan:
            safety = replace(safety, replan=False)
        elif not from_nominal and config.follows_plan:
            away = 1e3 * math.dist(nominal.p, measured.p)
            turned = math.degrees(abs(wrap_angle(nominal.yaw - measured.yaw)))
            what = f"off the plan by {away:.0f} mm and {turned:.0f} deg: replanning"
            texts.append(StatusText(Severity.WARNING, what))
        plan = requested(plan, apply_us)
        return replace(state, plan=plan, safety=safety, progress=progress), request

    def _see_accuracy(
        self,
        state: FlightState,
        estimate: StateEstimate,
        covariance: Array | None,
        pose: Array | None,
        texts: list[StatusText],
    ) -> FlightState:
        """Say what the sensors' errors add to the tube, once that is known."""
        if covariance is None or pose is None or state.accuracy.told:
            return state
        if state.aiding.unaided_us >= self.config.limits.aiding_loss_us:
            # How sure it is without a position is no property of the sensors: look anew later.
            begun = state.accuracy == AccuracyMemory()
            return state if begun else replace(state, accuracy=AccuracyMemory())
        safe_set, source = state.kept.source, state.aiding.pose.value
        position = self._clearance.deviation(estimate, pose) if safe_set.zones else 0.0
        sure = self._accuracy.see(
            state.accuracy, state.t_us, safe_set, source, position, covariance, texts
        )
        return replace(state, accuracy=sure)

    def _keep_clear(
        self, state: FlightState, estimate: StateEstimate, pose: Array | None
    ) -> FlightState:
        """The state with clearances that have grown by what the estimate is uncertain about now."""
        whole, wind, moved = state.kept.whole, self._wind_room(state.record), state.aiding.unproven
        kept = self._clearance.keep(whole, state.mission.safe_set, estimate, pose, wind, moved)
        return self._with_room(replace(state, kept=kept), estimate)

    def _with_room(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """The state with zones that take no more than their room, and their speed."""
        kept, target = state.kept, state.reference
        if not (state.vehicle.flies and kept.source.zones):
            return state
        report = self._safe_sets.margins(kept, estimate, target)
        kept = self._room.limit(kept, report, estimate, target)
        return state if kept is state.kept else replace(state, kept=kept)

    def _wind_room(self, memory: Tick) -> Vec2:
        """What the memory of wind in force can add to the tube [m, NED]."""
        if not self.config.follows_plan:
            return 0.0, 0.0
        return beyond_covered(self._safe_sets.loop_tube, memory.wind)

    def _pose_error(
        self, state: FlightState, estimate: StateEstimate, covariance: Array | None
    ) -> Array | None:
        """Covariance (6, 6) of position [m, NED] and attitude [rad, NED], as clearances grow by it.

        ``covariance`` (17, 17) [SI] is that of the filter, if there is one; without, exact states
        are uncertain while a part of them is missing. None: certain.
        """
        fusion = state.fusion
        if covariance is not None and fusion is not None:
            return pose_covariance(covariance, estimate, self._sensed.correlated_error(fusion))
        if fusion is None and state.aiding is not AIDED:
            position, attitude = state.aiding.position_sigma, state.aiding.attitude_sigma
            return np.diag((position**2,) * 3 + (attitude**2,) * 3)
        return None

    def _report_slowly(
        self, state: FlightState, estimate: StateEstimate, now_us: int
    ) -> FlightState:
        """Reference, margins, arming checks and battery, once a planning period."""
        target = self._horizon.target(self._commander.mode(state), state, estimate, now_us)
        airframe, period = self.config.airframe, 1e-6 * self.config.mpc_period_us
        thrust, levels = state.record.actuator_command.rotor_thrust, self._battery_levels
        return replace(
            state,
            constraints=self._safe_sets.margins(state.kept, estimate, target),
            reference=target if state.vehicle.flies else None,
            arming=self._commander.arming_report(state, estimate),
            battery=drained(airframe, levels, state.battery, thrust, period),
        )

    def _actuate(
        self, state: FlightState, r: Tick, estimate: StateEstimate, ticks: int, *, flown: bool
    ) -> tuple[ActuatorCommand, Tick, bool]:
        """Close the loops of a record, idle or stay still; the safety gate is the last law.

        Also the record for the next tick, and whether the gate replaced the command.
        """
        last, airframe, armed = state.record, self.config.airframe, state.vehicle.armed
        if flown:
            tube = self._watch.tube(state)
            r.payload.gripped = 1.0 if state.vehicle.gripper > 0.0 else 0.0
            self._fast.step(r, ticks, self.zones_now(state), state.damage.health, tube)
            wanted = r.actuator_command
            if not r.flags & GATE_NEEDED:  # what flies is armed
                return wanted, r, False
        elif armed:
            # A folded arm hangs down without swinging through.
            torque = [-c * rate for c, rate in zip(self._damping, estimate.qd_arm, strict=True)]
            idle = (self.config.limits.idle_thrust,) * airframe.rotors
            wanted = ActuatorCommand(idle, tuple(torque))
            r = at_rest(airframe, estimate, r)
        else:
            wanted = stopped(airframe)
        sent, replaced = gate(airframe, wanted, last.actuator_command, armed)
        if replaced:
            # The NaN is in the loops' new memory as well: discard that.
            found, r = r, last.copy()
            r.take_given(found)
            r.flags, r.margin = found.flags, found.margin
        r.actuator_command = sent
        return sent, r, replaced

    def _see_damage(self, state: FlightState, r: Tick, controlled: Controlled) -> Damage:
        """What is known of the actuators. Reads estimate, joints; writes watch.

        Without an inertial unit, how the vehicle moves shows nothing, and without encoders nothing
        of the joints; nor does it after a jump of time: what was commanded has not been done
        meanwhile.
        """
        lost = state.aiding.lost
        blind = bool(lost) and state.aiding.has_lost(Sensor.IMU)
        watches = controlled.flown and self._watches and not blind
        if not watches or self._jumped(state, controlled.inputs.sensors.t_us):
            pause(r.watch)
            return state.damage
        now, legs = 1e-6 * controlled.inputs.sensors.t_us, self.config.airframe.leg_length
        r.watch.aloft = is_aloft(state, now, legs)
        return self._damage.see(
            state.damage,
            state.record,
            r,
            controlled.ticks,
            memory=state.fusion,
            angles_known=not lost,
        )

    def zones_now(self, state: FlightState) -> Array:
        """The zones (zones, k) [SI] for the safety filter.

        Made anew where they or their target changed.
        No zones where the vehicle descends because it does not know where it is.
        """
        kept, target = state.kept, state.reference
        blind = state.aiding.unaided_us >= self.config.limits.aiding_loss_us
        if blind and state.vehicle.mode is Mode.DESCEND:
            return NO_ZONES
        known, known_target, zones = self._zones
        if kept is not known or target is not known_target:
            same = kept.safe_set is known.safe_set and kept.beyond == known.beyond
            if not same or kept.safe_set.kind is ConstraintKind.WORKSPACE:
                zones = moving_zones(kept.safe_set, target, kept.beyond)
            self._zones = (kept, target, zones)
        return zones


def freeze_arm(r: Tick, estimate: StateEstimate, kinds: JointVector) -> None:
    """Plan the failed joints, by their ``kinds`` [1], as they are. Writes plan, u."""
    for i in range(len(kinds)):
        if kinds[i] != SOUND:
            r.plan.q_arm[i], r.plan.qd_arm[i] = estimate.q_arm[i], 0.0
            r.u.qdd_arm[i] = 0.0
