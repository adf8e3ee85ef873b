"""Takeoff: the end-effector's reference climbs from where the vehicle stood."""

from __future__ import annotations

from fsw.autopilot.flight.modes.base import CONTINUE, FlightMode, ModeResult, Px4Mode
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.mpc.reference import still_at, vertical_ramp
from fsw.autopilot.signals import EndEffectorTarget, Mode, StateEstimate


class Takeoff(FlightMode):
    """PX4's AUTO.TAKEOFF; Hold follows."""

    mode = Mode.TAKEOFF
    px4 = Px4Mode(4, 2, 17, "takeoff", standard=8)
    enter_from = frozenset({Mode.HOLD, Mode.MISSION, Mode.OFFBOARD})
    before_arming = True
    lifts_off = True
    manual = True

    def refusal(self, context: Situation) -> str | None:
        """A vehicle that stands."""
        if not context.landed and context.mode is not Mode.TAKEOFF:
            return "no takeoff: the vehicle is in the air already"
        return None

    def waits(self, state: FlightState, now_us: int) -> str | None:
        """Dropped when arming does not follow in time."""
        wait_us = self.config.limits.takeoff_wait_us
        if now_us - state.vehicle.intended_us < wait_us:
            return None
        return f"takeoff cancelled: not armed within {wait_us * 1e-6:g} s"

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """Done when the reference has climbed."""
        climb_us = 1e6 * state.vehicle.climb / self.config.limits.climb_speed
        if estimate.t_us - state.vehicle.mode_begin_us < climb_us:
            return state, CONTINUE
        return state, ModeResult(Mode.HOLD, "climb done")

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        """Straight up at constant speed."""
        vehicle, speed = state.vehicle, self.config.limits.climb_speed
        start = still_at(vehicle.mode_origin, vehicle.mode_begin_us, vehicle.mode_yaw)
        return vertical_ramp(start, vehicle.climb, speed, t_us)
