"""Uploads into memory, and the uploaded mission in flight; pure, called by the tick."""

from __future__ import annotations

from dataclasses import replace

from fsw.model.kinematics import point_in_flight
from fsw.parameters.flight_config import FlightConfig
from fsw.runtime.flight_state import FlightState, MissionMemory
from fsw.signals import (
    EndEffectorTarget,
    MissionUpdate,
    SafeSet,
    StateEstimate,
)
from fsw.vehicle import mission
from fsw.vehicle.confine import joined
from fsw.vehicle.leg import Pace
from fsw.vehicle.mission import Happening, Whereabouts
from fsw.vehicle.modes import Event

_LEAST_ACCELERATION = 0.01  # m/s^2; a leg within none would never end


def pace_of(config: FlightConfig) -> Pace:
    """How fast missions are flown: within what the start-up analysis reckons with."""
    limits, surroundings = config.limits, config.surroundings
    return Pace(
        limits.mission_speed,
        max(surroundings.target_acceleration, _LEAST_ACCELERATION),
        limits.mission_turn_rate,
        limits.mission_turn_acceleration,
    )


def received(
    memory: MissionMemory, update: MissionUpdate | None, announced: SafeSet | None
) -> MissionMemory:
    """Take in what was uploaded and announced; the safe set in force is both together."""
    if announced is not None:
        memory = replace(memory, announced=announced)
    if update is not None:
        if update.fence is not None:
            memory = replace(memory, fence=update.fence)
        if update.rally is not None:
            memory = replace(memory, rally=update.rally)
    safe_set = joined(memory.announced, memory.fence)
    return memory if safe_set == memory.safe_set else replace(memory, safe_set=safe_set)


def with_mission(
    state: FlightState, update: MissionUpdate, config: FlightConfig, now_us: int
) -> FlightState:
    """Take in a new mission or another current step."""
    flight = state.mission.flight
    if update.steps is not None:
        flight = mission.loaded(update.steps, flight.progress.reached_count)
    if update.current is not None and update.current < len(flight.steps):
        flight = mission.jumped(flight, update.current, now_us, pace_of(config))
    return replace(state, mission=replace(state.mission, flight=flight))


def with_speed(state: FlightState, speed: float | None) -> FlightState:
    """Fly to places at another speed [m/s], a mission from its next leg on; None: as usual."""
    flight = replace(state.mission.flight, speed=speed)
    vehicle = replace(state.vehicle, speed=speed)
    return replace(state, vehicle=vehicle, mission=replace(state.mission, flight=flight))


def begin(state: FlightState, reference: EndEffectorTarget, config: FlightConfig) -> FlightState:
    """Fly the mission from a reference on."""
    flight = mission.begun(state.mission.flight, reference, pace_of(config))
    return replace(state, mission=replace(state.mission, flight=flight))


def leave(state: FlightState, event: Event) -> FlightState:
    """Another mode takes over, at the mission's own wish or not."""
    flight = state.mission.flight
    if event is Event.TOUCHED_DOWN:
        flight = mission.touched_down(flight)
    elif not mission.handed_over(flight, event):
        flight = mission.left(flight)
    if flight is state.mission.flight:
        return state
    return replace(state, mission=replace(state.mission, flight=flight))


def fly(
    state: FlightState, estimate: StateEstimate, config: FlightConfig
) -> tuple[FlightState, Happening]:
    """One tick of the mission."""
    flight, home = state.mission.flight, state.vehicle.home
    where = Whereabouts(
        estimate.t_us,
        point_in_flight(estimate, config.airframe.link_length)[0],
        -estimate.p_WB[2],
        home.p[2] if home is not None else -config.airframe.leg_length,
        state.mission.safe_set,
        state.vehicle.look_at,
    )
    moved, happening = mission.advance(flight, where, pace_of(config))
    if moved is flight:
        return state, happening
    return replace(state, mission=replace(state.mission, flight=moved)), happening
