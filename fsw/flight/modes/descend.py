"""Descend: straight down without plans, where nothing else can be flown, until touch-down."""

from __future__ import annotations

from dataclasses import replace

from fsw.flight.land_detector import is_low
from fsw.flight.modes.base import CONTINUE, FlightMode, ModeResult, Px4Mode, moved
from fsw.flight.state import FlightState
from fsw.mpc.reference import still_at
from fsw.signals import EndEffectorTarget, Mode, StateEstimate

_PRESSING = 0.15  # m that the plan is below the vehicle: more than the loops leave in the air


class Descend(FlightMode):
    """PX4's DESCEND, which it shows as AUTO.LAND; no command begins it."""

    mode = Mode.DESCEND
    px4 = Px4Mode(4, 6, selectable=False, offered=False)

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """Touch-down: the plan sinks and the vehicle does not, for a while.

        The height is asked only while it is measured.
        """
        limits, nominal = self.config.limits, state.nominal
        measured = state.aiding.unaided_us < limits.aiding_loss_us
        sinks = abs(estimate.v_WB[2]) > 0.5 * limits.land_speed
        pressing = nominal is not None and nominal.p[2] - estimate.p_WB[2] > _PRESSING
        if sinks or not pressing or (measured and not is_low(self.config, estimate)):
            return moved(state, estimate), CONTINUE
        if estimate.t_us - state.vehicle.moved_us < limits.landed_time_us:
            return state, CONTINUE
        state = replace(state, vehicle=replace(state.vehicle, landed=True))
        return state, ModeResult(Mode.DISARMED, "touched down")

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        """Where it began: the planner, if there is one, is asked for the day it is needed again."""
        vehicle = state.vehicle
        return still_at(vehicle.mode_origin, t_us, vehicle.mode_yaw)
