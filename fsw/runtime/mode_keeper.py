"""The slow half of a tick: commands, faults and milestones move the vehicle between modes.

Every function takes a state and returns one; almost every tick it is the same object.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from fsw.control.cascade import at_rest, in_hover
from fsw.model.kinematics import point_in_flight
from fsw.mpc.reference import still_at
from fsw.parameters.flight_config import FlightConfig
from fsw.runtime.flight_state import FlightState, PlanMemory
from fsw.runtime.mission_keeper import begin, fly, leave, with_mission, with_speed
from fsw.runtime.mode_reference import mode_reference
from fsw.runtime.planning import nominal_at_rest
from fsw.runtime.steering_keeper import SteeringKeeper
from fsw.signals import (
    Charge,
    CommandAck,
    CommandRequest,
    EndEffectorTarget,
    Home,
    MissionUpdate,
    Mode,
    Severity,
    StateEstimate,
    StatusText,
    Vec3,
)
from fsw.vehicle.commands import decide
from fsw.vehicle.failsafes import battery_low, battery_text, setpoints_lost, station_lost
from fsw.vehicle.faults import RESPONSES, Evidence, Response, detect
from fsw.vehicle.mission import refusal
from fsw.vehicle.mode_commands import STANDBY_EVENTS, arming_refusal, entry_refusal
from fsw.vehicle.modes import Event, next_mode
from fsw.vehicle.repeats import answered_before, remember
from fsw.vehicle.situation import ACCEPTED, Decision, Situation

_DOING: dict[Mode, str] = {Mode.HOLD: "holding", Mode.RETURN: "returning", Mode.LAND: "landing"}
_PRESSING = 0.05  # m that the plan is below the vehicle
# These go on with what a failsafe began.
_GOES_ON = (Event.HOME_REACHED, Event.CLIMB_DONE, Event.TRAJECTORY_DONE, Event.MISSION_DONE)


def answer(
    request: CommandRequest, situation: Situation, texts: list[StatusText]
) -> tuple[CommandAck, Decision]:
    """Decide a command; a reason becomes a text for the operator."""
    decision = decide(request, situation)
    if decision.reason:
        harmless = decision.result == ACCEPTED and not decision.alarming
        severity = Severity.INFO if harmless else Severity.CRITICAL
        texts.append(StatusText(severity, decision.reason))
    return _ack(request, decision.result), decision


def _ack(request: CommandRequest, result: int) -> CommandAck:
    return CommandAck(request.command, result, request.source_system, request.source_component)


class ModeKeeper:
    """Applies the mode table to the flight state of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        self._steering = SteeringKeeper(config)
        self._minders: dict[
            Mode, Callable[[FlightState, StateEstimate, list[StatusText]], FlightState]
        ] = {
            Mode.DISARMED: self._mind_standby,
            Mode.TAKEOFF: self._mind_takeoff,
            Mode.TRAJECTORY: self._mind_trajectory,
            Mode.RETURN: self._mind_return,
            Mode.OFFBOARD: self._mind_offboard,
            Mode.MISSION: self._fly_mission,
            Mode.LAND: self._mind_touch_down,
        }

    def obey(
        self,
        state: FlightState,
        estimate: StateEstimate,
        requests: tuple[CommandRequest, ...],
        texts: list[StatusText],
    ) -> tuple[FlightState, list[CommandAck]]:
        """Carry out commands in the order they came; a repeated one is answered again only."""
        acks = []
        for request in requests:
            memory = state.vehicle.answered
            before = answered_before(memory, request, estimate.t_us)
            if before is not None:
                acks.append(_ack(request, before.result))
                continue
            ack, decision = answer(request, self.situation(state, estimate), texts)
            acks.append(ack)
            state = self._carry_out(state, decision, estimate, texts)
            memory = remember(memory, request, ack.result, estimate.t_us)
            state = replace(state, vehicle=replace(state.vehicle, answered=memory))
        return state, acks

    def situation(self, state: FlightState, estimate: StateEstimate) -> Situation:
        """What a decision may depend on now."""
        limits, vehicle, stream = self._config.limits, state.vehicle, state.mission.stream
        steering = self._config.steering
        asked = state.steer.aim.joints if state.steer.aim is not None else None
        return Situation(
            mode=vehicle.mode,
            landed=vehicle.landed,
            estimate_valid=state.invalid_ticks == 0,
            targets_ahead=bool(stream) and stream[-1].t_us >= estimate.t_us,
            standing_unclear=self._standing_unclear(estimate),
            inconsistent="; ".join(state.mission.refusals),
            mission=state.mission.flight.progress,
            mission_refusal=refusal(state.mission.flight, vehicle.landed),
            setpoint_fresh=self._steering.is_fresh(state, estimate.t_us),
            position=estimate.p_WB,
            yaw=estimate.yaw,
            joints=asked or estimate.q_arm,
            origin=self._config.origin,
            home=vehicle.home,
            safe_set=state.mission.safe_set,
            climb_range=(limits.airborne_height, limits.takeoff_climb_most),
            airframe=self._config.airframe,
            charge=state.battery.charge,
            speed=vehicle.speed or steering.cruise_speed,
            speed_most=steering.speed,
            turn_rate=steering.yaw_rate,
            acceleration=steering.acceleration,
        )

    def arming_refusal(self, state: FlightState, estimate: StateEstimate) -> str:
        """Why the vehicle cannot be armed now, for telemetry; empty if it could be, or is."""
        if state.vehicle.armed:
            return ""
        if state.vehicle.mode is Mode.FAULT:
            return "terminated: restart the flight software"
        return arming_refusal(self.situation(state, estimate)) or ""

    def mind_faults(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Name what is wrong, say it once, and terminate where the table says so."""
        vehicle, plan = state.vehicle, state.plan
        if vehicle.mode is Mode.FAULT:
            return state  # what ended the flight stays on show
        faults = detect(
            Evidence(
                vehicle.armed,
                vehicle.flies,
                state.invalid_ticks,
                estimate.R_WB[8],
                estimate.t_us - plan.since_us,
                self._config.mpc_period_us,
                plan.refused,
                state.output_replaced,
            )
        )
        if not faults and not vehicle.failures:
            return state
        names = tuple(fault.value for fault in faults)
        if names == vehicle.failures:
            return state
        for fault in faults:
            if fault.value not in vehicle.failures:
                response = RESPONSES[fault]
                severity = (
                    Severity.EMERGENCY if response is Response.TERMINATE else Severity.WARNING
                )
                texts.append(StatusText(severity, f"{fault.value}: {response.name.lower()}"))
        state = replace(state, vehicle=replace(vehicle, failures=names))
        if any(RESPONSES[fault] is Response.TERMINATE for fault in faults):
            return self._change(state, Event.TERMINATE, estimate, texts)
        return state

    def mind_milestones(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Mode changes the vehicle makes by itself."""
        vehicle = state.vehicle
        if vehicle.home is None:
            home = Home(estimate.p_WB, estimate.yaw)
            return replace(state, vehicle=replace(vehicle, home=home))
        minder = self._minders.get(vehicle.mode)
        if minder is not None:
            state = minder(state, estimate, texts)
        state = self._mind_station(state, estimate, texts)
        return self._mind_battery(state, estimate, texts)

    def _mind_takeoff(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        climb_us = 1e6 * state.vehicle.climb / self._config.limits.climb_speed
        if estimate.t_us - state.vehicle.anchor_us < climb_us:
            return state
        return self._change(state, Event.CLIMB_DONE, estimate, texts)

    def _mind_trajectory(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        stream = state.mission.stream
        if stream and stream[-1].t_us >= estimate.t_us:
            return state
        return self._change(state, Event.TRAJECTORY_DONE, estimate, texts)

    def _mind_standby(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Forget what was chosen before arming, where it waits too long or is gone."""
        vehicle, now_us = state.vehicle, estimate.t_us
        waited_us = now_us - vehicle.standby_us
        wait_us = self._config.limits.takeoff_wait_us
        if vehicle.standby is Mode.TAKEOFF and waited_us >= wait_us:
            text = f"takeoff forgotten: not armed within {wait_us * 1e-6:g} s"
        elif vehicle.standby is Mode.OFFBOARD and not self._steering.is_fresh(state, now_us):
            text = "offboard forgotten: set-points stopped before arming"
        else:
            return state
        texts.append(StatusText(Severity.WARNING, text))
        return replace(state, vehicle=replace(vehicle, standby=Mode.HOLD))

    def _mind_return(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Home, wait there, then land; or stay there."""
        if not self._steering.is_home(state):
            return self._moving(state, estimate)
        wait = self._config.limits.return_wait
        if wait < 0.0:
            return self._change(state, Event.HOLD, estimate, texts, kept=True)
        if estimate.t_us - state.vehicle.still_since_us < 1e6 * wait:
            return state
        return self._change(state, Event.HOME_REACHED, estimate, texts)

    def _mind_offboard(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        if not self._steering.is_fresh(state, estimate.t_us):
            event = setpoints_lost(self._config.limits.setpoint_loss_action)
            return self._fail_safe(state, event, "offboard set-points stopped", estimate, texts)
        if state.vehicle.landed:
            if self._steering.wants_to_rise(state, estimate):
                return self._lift_off(state, estimate)
            return state
        if not (self._stands(estimate) and self._steering.wants_to_sink(state, estimate)):
            return self._moving(state, estimate)
        if estimate.t_us - state.vehicle.still_since_us < self._config.limits.landed_time_us:
            return state
        return replace(state, vehicle=replace(state.vehicle, landed=True))

    def _mind_touch_down(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Descending and not sinking is standing, sliding or not: no loop may fight the ground.

        Where the plan is lower than the vehicle can be, the ground has been felt already: to wait
        until it lies still let loops and arm work against it until it tipped over.
        """
        limits, vehicle = self._config.limits, state.vehicle
        low = self._height_above_standing(estimate) < limits.landed_height
        held_up = abs(estimate.v_WB[2]) < limits.landed_speed
        if not (low and self._presses(state, estimate)):
            if not (low and held_up):
                return self._moving(state, estimate)
            if estimate.t_us - vehicle.still_since_us < limits.landed_time_us:
                return state
        state = replace(state, vehicle=replace(vehicle, landed=True))
        return self._change(state, Event.TOUCHED_DOWN, estimate, texts)

    def _presses(self, state: FlightState, estimate: StateEstimate) -> bool:
        """Whether the plan has gone on down where the vehicle has not."""
        if state.nominal is None:
            return False
        return state.nominal.p[2] - estimate.p_WB[2] > _PRESSING

    def _mind_station(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Act where the ground station that was there is silent for too long."""
        vehicle = state.vehicle
        silent_us = estimate.t_us - vehicle.station_us
        if vehicle.station_us < 0 or silent_us < self._config.limits.station_timeout_us:
            return state
        state = replace(state, vehicle=replace(vehicle, station_us=-1))
        event = station_lost(self._config.limits.station_loss_action, vehicle.mode)
        if event is None or not vehicle.flies:
            return state
        text = f"no ground station for {silent_us * 1e-6:.0f} s"
        return self._fail_safe(state, event, text, estimate, texts)

    def _mind_battery(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Say each level once, and act in flight as the parameter says."""
        charge, vehicle = state.battery.charge, state.vehicle
        if charge <= vehicle.charge:
            return state
        state = replace(state, vehicle=replace(vehicle, charge=charge))
        said = battery_text(state.battery)
        event = battery_low(self._config.limits.low_battery_action, charge, vehicle.mode)
        if event is None or not vehicle.flies:
            texts.append(said)
            return state
        return self._fail_safe(state, event, said.text, estimate, texts)

    def _fail_safe(
        self,
        state: FlightState,
        event: Event,
        why: str,
        estimate: StateEstimate,
        texts: list[StatusText],
    ) -> FlightState:
        """Take the vehicle over, and say why; a pilot's next mode takes it back."""
        mode = next_mode(state.vehicle.mode, event)
        if mode is None:
            return state
        text = f"failsafe: {why}, {_DOING[mode]}"
        texts.append(StatusText(Severity.CRITICAL, text))
        before = state.vehicle.failsafe_from or state.vehicle.mode
        state = self._change(state, event, estimate, texts, kept=True)
        return replace(state, vehicle=replace(state.vehicle, failsafe_from=before))

    def _carry_out(
        self,
        state: FlightState,
        decision: Decision,
        estimate: StateEstimate,
        texts: list[StatusText],
    ) -> FlightState:
        state = self._remember(state, decision, estimate)
        if decision.event is not None:
            state = self._change(state, decision.event, estimate, texts)
        if decision.event is Event.ARM:
            state = self._begin_standby(state, estimate, texts)
        if decision.stop:
            state = self._steering.stop(state, estimate)
        if decision.goto is not None:
            state = self._steering.go_to(state, decision.goto, estimate)
        if decision.orbit is not None:
            state = self._steering.circle(state, decision.orbit, estimate)
        if decision.joints is not None:
            state = self._steering.set_joints(state, decision.joints, estimate)
        return state

    def _remember(
        self, state: FlightState, decision: Decision, estimate: StateEstimate
    ) -> FlightState:
        """What a decision says about the flight that follows."""
        vehicle, limits = state.vehicle, self._config.limits
        if decision.home is not None:
            vehicle = replace(vehicle, home=decision.home)
        if decision.event is Event.TAKE_OFF or decision.standby is Mode.TAKEOFF:
            climb = limits.takeoff_climb if decision.climb is None else decision.climb
            vehicle = replace(vehicle, climb=climb)
        if decision.standby is not None:
            vehicle = replace(vehicle, standby=decision.standby, standby_us=estimate.t_us)
        if decision.look_at is not None:
            vehicle = replace(vehicle, look_at=decision.look_at.place)
        if vehicle is not state.vehicle:
            state = replace(state, vehicle=vehicle)
        if decision.speed is not None:
            state = with_speed(state, decision.speed.speed)
        if decision.look_at is not None:
            state = self._steering.look_at(state, estimate)
        if decision.mission_step is None:
            return state
        step = MissionUpdate(current=decision.mission_step)
        return with_mission(state, step, self._config, estimate.t_us)

    def _begin_standby(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Go on to the mode that was chosen before arming, if it is still possible."""
        event = STANDBY_EVENTS.get(state.vehicle.standby)
        state = replace(state, vehicle=replace(state.vehicle, standby=Mode.HOLD))
        if event is None:
            return state
        against = entry_refusal(event, self.situation(state, estimate))
        if against is None:
            return self._change(state, event, estimate, texts)
        texts.append(StatusText(Severity.CRITICAL, against))
        return state

    def _fly_mission(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        if state.mission.flight.leg is None:
            # Another mission came, or none: not what the operator started.
            return self._change(state, Event.HOLD, estimate, texts)
        state, happening = fly(state, estimate, self._config)
        if happening.text:
            severity = Severity.WARNING if happening.unmet else Severity.INFO
            texts.append(StatusText(severity, happening.text))
        if happening.look_at is not None:
            vehicle = replace(state.vehicle, look_at=happening.look_at.place)
            state = replace(state, vehicle=vehicle)
        if happening.event is None:
            return state
        return self._change(state, happening.event, estimate, texts)

    def _change(
        self,
        state: FlightState,
        event: Event,
        estimate: StateEstimate,
        texts: list[StatusText],
        *,
        kept: bool = False,
    ) -> FlightState:
        """Go to the mode after an event; ``kept`` says that a failsafe's mark stays."""
        before = state.vehicle.mode
        mode = next_mode(before, event)
        if mode is None:
            return state
        texts.append(StatusText(Severity.INFO, f"{before.value} to {mode.value}: {event.value}"))
        anchor, anchor_yaw = self._anchor(state, event, estimate)
        state = leave(state, event)
        if mode is Mode.MISSION:
            state = begin(state, self._mission_start(state, estimate), self._config)
        rises = event is Event.START_MISSION and state.vehicle.landed
        if event in (Event.ARM, Event.TAKE_OFF) or rises:
            state = self._take_over(state, event, estimate)
        steer = self._steering.steer_into(state, mode, event, estimate)
        kept = kept or event in _GOES_ON
        vehicle = replace(
            state.vehicle,
            mode=mode,
            anchor=anchor,
            anchor_yaw=anchor_yaw,
            anchor_us=estimate.t_us,
            still_since_us=estimate.t_us,
            failsafe_from=state.vehicle.failsafe_from if kept else None,
        )
        if event is Event.ARM:
            vehicle = replace(vehicle, look_at=None, speed=None, charge=Charge.OK)
        return replace(state, vehicle=vehicle, steer=steer)

    def _take_over(self, state: FlightState, event: Event, estimate: StateEstimate) -> FlightState:
        """Start the fast loops where the vehicle is, when it begins to move or to fly."""
        landed = event is Event.ARM and self._stands(estimate)
        cascade, vehicle = state.cascade, state.vehicle
        if event is Event.ARM:
            airframe = self._config.airframe
            cascade = at_rest(airframe, estimate) if landed else in_hover(airframe, estimate)
            vehicle = replace(vehicle, home=Home(estimate.p_WB, estimate.yaw))
        plan = PlanMemory(
            since_us=estimate.t_us, next_id=state.plan.next_id, counters=state.plan.counters
        )
        return replace(
            state,
            vehicle=replace(vehicle, landed=landed),
            nominal=nominal_at_rest(estimate),
            plan=plan,
            cascade=cascade,
        )

    def _lift_off(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """Begin to fly in a mode that began on the ground."""
        state = self._take_over(state, Event.TAKE_OFF, estimate)
        steer = self._steering.steer_into(state, state.vehicle.mode, Event.TAKE_OFF, estimate)
        return replace(state, steer=steer)

    def _anchor(
        self, state: FlightState, event: Event, estimate: StateEstimate
    ) -> tuple[Vec3, float]:
        """Where the new mode's own reference begins: the old one's where it leads on."""
        goes_on = state.vehicle.flies and event in (
            Event.CLIMB_DONE,
            Event.TRAJECTORY_DONE,
            Event.MISSION_DONE,
            Event.LAND,
            Event.HOME_REACHED,
        )
        if goes_on:
            last = self._reference(state, estimate.t_us)
            return last.p_WE, last.yaw
        return point_in_flight(estimate, self._config.airframe.link_length)[0], estimate.yaw

    def _reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        return self._steering.target(state, t_us) or mode_reference(
            state.vehicle, state.mission, self._config.limits, t_us
        )

    def _mission_start(self, state: FlightState, estimate: StateEstimate) -> EndEffectorTarget:
        """The reference so far, unless it is far off or fast; then where the vehicle is."""
        here = point_in_flight(estimate, self._config.airframe.link_length)[0]
        if state.vehicle.flies:
            last = self._reference(state, estimate.t_us)
            near = math.dist(last.p_WE, here) < self._config.steering.leash
            if near and math.hypot(*last.v_WE) <= self._config.limits.mission_speed:
                return last
        return still_at(here, estimate.t_us, estimate.yaw)

    def _moving(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        return replace(state, vehicle=replace(state.vehicle, still_since_us=estimate.t_us))

    def _standing_unclear(self, estimate: StateEstimate) -> bool:
        limits, above = self._config.limits, self._height_above_standing(estimate)
        return above < limits.airborne_height and not self._stands(estimate)

    def _height_above_standing(self, estimate: StateEstimate) -> float:
        return -estimate.p_WB[2] - self._config.airframe.leg_length

    def _stands(self, estimate: StateEstimate) -> bool:
        """Near standing height and hardly moving."""
        limits = self._config.limits
        vx, vy, vz = estimate.v_WB
        return (
            self._height_above_standing(estimate) < limits.landed_height
            and vx * vx + vy * vy + vz * vz < limits.landed_speed**2
        )
