"""Mission: the uploaded mission is flown; after it Hold, Land or Return, as its last step says."""

from __future__ import annotations

import math

from fsw.autopilot.flight.commands.bounds import GRIPPER_OF_PX4
from fsw.autopilot.flight.mission import sequencer as sequencer
from fsw.autopilot.flight.mission.sequencer import MissionContext, Stage
from fsw.autopilot.flight.mission.trajectory_segment import MotionLimits, PushSegment
from fsw.autopilot.flight.modes.base import CONTINUE, FlightMode, Handover, ModeResult, Px4Mode
from fsw.autopilot.flight.setpoints.reference_governor import project
from fsw.autopilot.flight.setpoints.target_check import TargetCheck
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import FlightState, SetpointMemory
from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import (
    EndEffectorTarget,
    MissionUpdate,
    Mode,
    Severity,
    StateEstimate,
    StatusText,
)
from fsw.frozen import replace

_MIN_ACCELERATION = 0.01  # m/s^2; a segment within none would never end


class Mission(FlightMode):
    """PX4's AUTO.MISSION."""

    mode = Mode.MISSION
    px4 = Px4Mode(4, 4, 3, "mission", standard=6)
    before_arming = True
    lifts_off = True
    external_reference = True

    def __init__(self, config: FlightConfig) -> None:
        super().__init__(config)
        self._targets = TargetCheck(config, loop_tube(config))

    def refusal(self, context: Situation) -> str | None:
        """Needs a mission that can start or continue."""
        return sequencer.refusal(context.mission.flight, context.landed)

    def activate(
        self, state: FlightState, estimate: StateEstimate, handover: Handover
    ) -> FlightState:
        """Fly the mission from the current reference."""
        start = self._start(state, estimate, handover.reference)
        flight = sequencer.begun(state.mission.flight, start, motion_limits(self.config))
        mission = replace(state.mission, flight=flight)
        return replace(state, mission=mission, setpoint=SetpointMemory())

    def _start(
        self, state: FlightState, estimate: StateEstimate, last: EndEffectorTarget
    ) -> EndEffectorTarget:
        """The current reference, or the vehicle's position if that is far off or moves fast."""
        here = end_effector(self.config.airframe.bodies, estimate)[0]
        if state.vehicle.flies:
            near = math.dist(last.p_WE, here) < self.config.steering.max_lead_distance
            if near and math.hypot(*last.v_WE) <= self.config.limits.mission_speed:
                return last
        return still_at(here, estimate.t_us, estimate.yaw)

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """One tick of the mission."""
        flight, vehicle, config = state.mission.flight, state.vehicle, self.config
        if flight.segment is None:
            # Another mission came, or none: not what the operator started.
            return state, ModeResult(Mode.HOLD, "hold", completed=False)
        home_z = vehicle.home.p[2] if vehicle.home is not None else -config.airframe.leg_length
        context = MissionContext(
            now_us=estimate.t_us,
            p_WE=end_effector(config.airframe.bodies, estimate)[0],
            height=-estimate.p_WB[2],
            home_z=home_z,
            limits=motion_limits(config),
            safe_set=state.kept.safe_set,
            look_at=vehicle.look_at,
            meet=lambda p, force: self._targets.meet(p, force, state.kept.source, estimate.t_us),
        )
        flown, event = sequencer.advance(flight, context)
        if flown is flight:
            return state, CONTINUE
        if event.looks:
            state = replace(state, vehicle=replace(vehicle, look_at=event.look_at))
        if event.gripper is not None and config.is_above_px4:
            event = replace(event, text=GRIPPER_OF_PX4, unmet=True)
        elif event.gripper is not None:
            state = replace(state, vehicle=replace(state.vehicle, gripper=event.gripper))
        severity = Severity.WARNING if event.unmet else Severity.INFO
        texts = (StatusText(severity, event.text),) if event.text else ()
        state = replace(state, mission=replace(state.mission, flight=flown))
        return state, ModeResult(event.next_mode, event.cause, texts)

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        """Along the segment, inside the safe set."""
        segment = state.mission.flight.segment
        if segment is None:
            return super().reference(state, t_us)
        touches = isinstance(segment, PushSegment)
        return project(segment.at(t_us), state.kept.safe_set, touches=touches)


def motion_limits(config: FlightConfig) -> MotionLimits:
    """Mission speed [m/s], within the limit of the start-up analysis."""
    limits, surroundings = config.limits, config.surroundings
    return MotionLimits(
        limits.mission_speed,
        max(surroundings.target_acceleration, _MIN_ACCELERATION),
        limits.mission_turn_rate,
        limits.mission_turn_acceleration,
    )


def left(state: FlightState, next_mode: Mode) -> FlightState:
    """The mission as the vehicle leaves the mode: paused, unless its last step asked for that.

    A mission that ends in a landing is complete when that has touched down.
    """
    flight, mode = state.mission.flight, state.vehicle.mode
    if mode is Mode.LAND and next_mode is Mode.DISARMED and state.vehicle.landed:
        flight = sequencer.touched_down(flight)
    elif not (mode is Mode.MISSION and flight.stage is Stage.GONE):
        flight = sequencer.paused(flight)
    if flight is state.mission.flight:
        return state
    return replace(state, mission=replace(state.mission, flight=flight))


def with_update(
    state: FlightState, update: MissionUpdate, config: FlightConfig, now_us: int
) -> FlightState:
    """Store a new mission or another current step."""
    flight = state.mission.flight
    if update.steps is not None:
        flight = sequencer.loaded(update.steps, flight.progress.reached_count)
    if update.current is not None and update.current < len(flight.steps):
        flight = sequencer.jumped(flight, update.current, now_us, motion_limits(config))
    return replace(state, mission=replace(state.mission, flight=flight))
