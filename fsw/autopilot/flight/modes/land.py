"""Land: the reference descends until touch-down is detected, then the vehicle disarms."""

from __future__ import annotations

from fsw.autopilot.flight.modes.base import FlightMode, ModeResult, Px4Mode, touch_down
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.mpc.reference import still_at, vertical_ramp
from fsw.autopilot.signals import EndEffectorTarget, Mode, StateEstimate

_FAR_DOWN = -100.0  # m; the descent ends where the ground is felt, wherever it is


class Land(FlightMode):
    """PX4's AUTO.LAND. To interrupt a landing, command Hold first."""

    mode = Mode.LAND
    px4 = Px4Mode(4, 6, 18, "land", standard=7)
    interruptible = False
    interrupts_landing = True
    continues_reference = True

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """Down until the ground carries the vehicle."""
        return touch_down(self.config, state, estimate)

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        """Straight down at constant speed."""
        vehicle, speed = state.vehicle, self.config.limits.land_speed
        start = still_at(vehicle.mode_origin, vehicle.mode_begin_us, vehicle.mode_yaw)
        return vertical_ramp(start, _FAR_DOWN, speed, t_us)
