"""Descend: straight down without plans, where nothing else can be flown, until touch-down."""

from __future__ import annotations

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.flight.descent import is_hurried
from fsw.autopilot.flight.modes.base import FlightMode, ModeResult, Px4Mode, touch_down
from fsw.autopilot.flight.safety.retreat import retreat_place
from fsw.autopilot.flight.setpoints.generator import PositionGoal
from fsw.autopilot.flight.state import FlightState, SetpointMemory
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import Mode, MotionSetpoint, StateEstimate
from fsw.frozen import replace


class Descend(FlightMode):
    """PX4's DESCEND, which it shows as AUTO.LAND; no command begins it."""

    mode = Mode.DESCEND
    px4 = Px4Mode(4, 6, 12, "descend", selectable=False, offered=False)

    def __init__(self, config: FlightConfig) -> None:
        super().__init__(config)
        self._body = config.body
        self._bodies = config.airframe.bodies
        self._room = stand_off(config.planner.walls)

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """Down until the ground carries the vehicle."""
        return touch_down(self.config, state, estimate)

    def aim(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """Where no position or attitude is measured, the place to draw back to.

        Clearances have grown by what the place is uncertain by, as far as there is room for.
        """
        safe_set, limits = state.kept.whole.safe_set, self.config.limits
        if not (is_hurried(state.aiding, limits.aiding_loss_us) and safe_set.zones):
            known = state.setpoint.goal is None
            return state if known else replace(state, setpoint=SetpointMemory())
        place = retreat_place(safe_set, estimate, self._body, self._bodies, self._room)
        goal = PositionGoal(MotionSetpoint(False, place))
        return replace(state, setpoint=SetpointMemory(goal=goal))
