"""Return: climbs, goes home or to a nearer rally point, waits there, then lands."""

from __future__ import annotations

from fsw.autopilot.flight.land_detector import in_the_air
from fsw.autopilot.flight.mission.sequencer import nearest
from fsw.autopilot.flight.modes.base import CONTINUE, FlightMode, Handover, ModeResult, Px4Mode
from fsw.autopilot.flight.setpoints.generator import PositionGoal, arrived
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import FlightState, SetpointMemory
from fsw.autopilot.signals import Home, Mode, MotionSetpoint, StateEstimate, Vec3
from fsw.frozen import replace


class Return(FlightMode):
    """PX4's AUTO.RTL."""

    mode = Mode.RETURN
    # Standard mode 5, safe recovery, is not announced as PX4 does: QGroundControl 4.4 then renames
    # the mode, and does not find what its own Return button is looking for.
    px4 = Px4Mode(4, 5, 5, "rtl", also_standard=5)
    interrupts_landing = True

    def refusal(self, context: Situation) -> str | None:
        """A vehicle in the air."""
        if context.mode is Mode.DISARMED:
            return "no return: the vehicle is not armed"
        return "no return: the vehicle is on the ground" if context.landed else None

    def activate(
        self, state: FlightState, estimate: StateEstimate, handover: Handover
    ) -> FlightState:
        """Start the return."""
        home = state.vehicle.home
        if home is None:
            return replace(state, setpoint=SetpointMemory())
        way = self._way_home(nearest(home, state.mission.rally, estimate.p_WB), estimate)
        return replace(state, setpoint=way)

    def _way_home(self, home: Home, estimate: StateEstimate) -> SetpointMemory:
        """Up to the height of return, across, down to where it waits, and there it ends.

        It waits in the air: home may have been set below the ground, where it would never arrive.
        """
        (x, y, z), limits = estimate.p_WB, self.config.limits
        lowest = -self.config.airframe.leg_length - limits.airborne_height
        height = max(min(z, home.p[2] - limits.return_height), -self.config.steering.highest)
        waits = min(max(height, home.p[2] - limits.return_descent), max(height, lowest))
        goal = PositionGoal(MotionSetpoint(False, (x, y, height)))
        across: Vec3 = (home.p[0], home.p[1], height)
        down: Vec3 = (home.p[0], home.p[1], waits)
        waypoints = (across, down) if waits > height else (across,)
        return SetpointMemory(self.generator.begin(estimate), goal, waypoints)

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """Home, wait there, then land; or stay there."""
        if not _is_home(state.setpoint):
            return in_the_air(state, estimate), CONTINUE
        wait = self.config.limits.return_wait
        if wait < 0.0:
            return state, ModeResult(Mode.HOLD, "return point reached")
        if estimate.t_us - state.vehicle.moved_us < 1e6 * wait:
            return state, CONTINUE
        return state, ModeResult(Mode.LAND, "return point reached")


def _is_home(setpoint: SetpointMemory) -> bool:
    """Whether the return path is complete."""
    reference, goal = setpoint.reference, setpoint.goal
    if reference is None or goal is None or goal.motion.p is None or setpoint.waypoints:
        return False
    return arrived(reference, goal.motion.p)
