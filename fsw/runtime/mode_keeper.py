"""The slow half of a tick: commands, faults and milestones move the vehicle between modes.

Every function takes a state and returns one; almost every tick it is the same object.
"""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.control.cascade import at_rest, in_hover
from fsw.model.arm_kinematics import point_in_flight
from fsw.parameters.flight_config import FlightConfig
from fsw.runtime.flight_state import FlightState, PlanMemory
from fsw.runtime.mode_reference import mode_reference
from fsw.runtime.planning import nominal_at_rest
from fsw.signals import (
    CommandAck,
    CommandRequest,
    Mode,
    StateEstimate,
    StatusText,
    Vec3,
)
from fsw.vehicle.commands import Decision, Situation, decide
from fsw.vehicle.faults import RESPONSES, Evidence, Response, detect
from fsw.vehicle.modes import Event, next_mode

SEVERITY_EMERGENCY, SEVERITY_WARNING, SEVERITY_NOTICE = 0, 4, 5  # MAV_SEVERITY


def answer(
    request: CommandRequest, situation: Situation, texts: list[StatusText]
) -> tuple[CommandAck, Decision]:
    """Decide a command; a reason becomes a text for the operator."""
    decision = decide(request, situation)
    if decision.reason:
        texts.append(StatusText(SEVERITY_WARNING, decision.reason))
    ack = CommandAck(
        request.command, decision.result, request.source_system, request.source_component
    )
    return ack, decision


class ModeKeeper:
    """Applies the mode table to the flight state of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config

    def obey(
        self,
        state: FlightState,
        estimate: StateEstimate,
        requests: tuple[CommandRequest, ...],
        texts: list[StatusText],
    ) -> tuple[FlightState, list[CommandAck]]:
        """Carry out commands in the order they came."""
        acks = []
        limits = self._config.limits
        for request in requests:
            stream = state.mission.stream
            ahead = bool(stream) and stream[-1].t_us >= estimate.t_us
            situation = Situation(
                mode=state.vehicle.mode,
                landed=state.vehicle.landed,
                estimate_valid=state.invalid_ticks == 0,
                targets_ahead=ahead,
                standing_unclear=self._standing_unclear(estimate),
                inconsistent="; ".join(state.mission.refusals),
                height=-estimate.p_WB[2],
                climb_range=(limits.airborne_height, limits.takeoff_climb_most),
            )
            ack, decision = answer(request, situation, texts)
            acks.append(ack)
            if decision.event is Event.TAKE_OFF:
                climb = self._climb(request.params[6], estimate)
                state = replace(state, vehicle=replace(state.vehicle, climb=climb))
            if decision.event is not None:
                state = self._change(state, decision.event, estimate, texts)
        return state, acks

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
                    SEVERITY_EMERGENCY if response is Response.TERMINATE else SEVERITY_WARNING
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
        now_us, limits, vehicle = estimate.t_us, self._config.limits, state.vehicle
        if vehicle.mode is Mode.TAKEOFF:
            climb_us = 1e6 * vehicle.climb / limits.climb_speed
            if now_us - vehicle.anchor_us >= climb_us:
                return self._change(state, Event.CLIMB_DONE, estimate, texts)
        elif vehicle.mode is Mode.TRAJECTORY:
            stream = state.mission.stream
            if not stream or stream[-1].t_us < now_us:
                return self._change(state, Event.TRAJECTORY_DONE, estimate, texts)
        elif vehicle.mode is Mode.LAND:
            if not self._stands(estimate):
                return replace(state, vehicle=replace(vehicle, still_since_us=now_us))
            if now_us - vehicle.still_since_us >= limits.landed_time_us:
                state = replace(state, vehicle=replace(vehicle, landed=True))
                return self._change(state, Event.TOUCHED_DOWN, estimate, texts)
        return state

    def _change(
        self, state: FlightState, event: Event, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        before = state.vehicle.mode
        mode = next_mode(before, event)
        if mode is None:
            return state
        texts.append(
            StatusText(
                SEVERITY_NOTICE, f"{state.vehicle.mode.value} to {mode.value}: {event.value}"
            )
        )
        anchor, anchor_yaw = self._anchor(state, event, estimate)
        state = self._take_over(state, event, estimate)
        vehicle = replace(
            state.vehicle,
            mode=mode,
            anchor=anchor,
            anchor_yaw=anchor_yaw,
            anchor_us=estimate.t_us,
            still_since_us=estimate.t_us,
        )
        return replace(state, vehicle=vehicle)

    def _take_over(self, state: FlightState, event: Event, estimate: StateEstimate) -> FlightState:
        """Start the fast loops where the vehicle is, when it begins to move or to fly."""
        if event not in (Event.ARM, Event.TAKE_OFF):
            return state
        landed = event is Event.ARM and self._stands(estimate)
        cascade = state.cascade
        if event is Event.ARM:
            airframe = self._config.airframe
            cascade = at_rest(airframe, estimate) if landed else in_hover(airframe, estimate)
        plan = PlanMemory(
            since_us=estimate.t_us, next_id=state.plan.next_id, counters=state.plan.counters
        )
        return replace(
            state,
            vehicle=replace(state.vehicle, landed=landed),
            nominal=nominal_at_rest(estimate),
            plan=plan,
            cascade=cascade,
        )

    def _anchor(
        self, state: FlightState, event: Event, estimate: StateEstimate
    ) -> tuple[Vec3, float]:
        """Where the new mode's own reference begins: the old one's where it leads on."""
        goes_on = state.vehicle.flies and event in (
            Event.CLIMB_DONE,
            Event.TRAJECTORY_DONE,
            Event.LAND,
        )
        if goes_on:
            limits = self._config.limits
            last = mode_reference(state.vehicle, state.mission, limits, estimate.t_us)
            return last.p_WE, last.yaw
        return point_in_flight(estimate, self._config.airframe.link_length)[0], estimate.yaw

    def _climb(self, height: float, estimate: StateEstimate) -> float:
        """From here to the height a takeoff asks for [m]; the usual climb where it names none."""
        if not math.isfinite(height):
            return self._config.limits.takeoff_climb
        return height + estimate.p_WB[2]

    def _standing_unclear(self, estimate: StateEstimate) -> bool:
        limits, above = self._config.limits, self._height_above_standing(estimate)
        return limits.landed_height <= above < limits.airborne_height

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
