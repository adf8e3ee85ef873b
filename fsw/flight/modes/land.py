"""Land: the reference descends until touch-down is detected, then the vehicle disarms."""

from __future__ import annotations

from fsw.flight.land_detector import is_low
from fsw.flight.modes.base import CONTINUE, FlightMode, ModeResult, Px4Mode, moved
from fsw.flight.state import FlightState
from fsw.frozen import replace
from fsw.mpc.reference import still_at, vertical_ramp
from fsw.signals import EndEffectorTarget, Mode, StateEstimate

_FAR_DOWN = -100.0  # m; the descent ends where the ground is felt, wherever it is
_PRESSING = 0.05  # m that the plan is below the vehicle


class Land(FlightMode):
    """PX4's AUTO.LAND. To interrupt a landing, command Hold first."""

    mode = Mode.LAND
    px4 = Px4Mode(4, 6, standard=7)
    interruptible = False
    interrupts_landing = True
    continues_reference = True

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """Touch-down: a descent is commanded and the vehicle does not sink.

        A plan below the vehicle is contact as well: while it waited for the vehicle to lie still,
        loops and arm worked against the ground until it tipped over.
        """
        limits = self.config.limits
        low = is_low(self.config, estimate)
        held_up = abs(estimate.v_WB[2]) < limits.landed_speed
        if not (low and _presses(state, estimate)):
            if not (low and held_up):
                return moved(state, estimate), CONTINUE
            if estimate.t_us - state.vehicle.moved_us < limits.landed_time_us:
                return state, CONTINUE
        state = replace(state, vehicle=replace(state.vehicle, landed=True))
        return state, ModeResult(Mode.DISARMED, "touched down")

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        """Straight down at constant speed."""
        vehicle, speed = state.vehicle, self.config.limits.land_speed
        start = still_at(vehicle.mode_origin, vehicle.mode_begin_us, vehicle.mode_yaw)
        return vertical_ramp(start, _FAR_DOWN, speed, t_us)


def _presses(state: FlightState, estimate: StateEstimate) -> bool:
    """Whether the plan is lower than the vehicle can be."""
    return state.nominal is not None and state.nominal.p[2] - estimate.p_WB[2] > _PRESSING
