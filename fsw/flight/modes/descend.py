"""Descend: straight down without plans, where nothing else can be flown, until touch-down."""

from __future__ import annotations

from fsw.flight.land_detector import is_low
from fsw.flight.modes.base import CONTINUE, FlightMode, ModeResult, Px4Mode, moved
from fsw.flight.retreat import retreat_place
from fsw.flight.setpoint_generator import PositionGoal
from fsw.flight.state import FlightState, SetpointMemory
from fsw.frozen import replace
from fsw.model.body import body_of
from fsw.mpc.reference import still_at
from fsw.parameters.consistency import stand_off
from fsw.parameters.flight_config import FlightConfig
from fsw.signals import EndEffectorTarget, Mode, MotionSetpoint, StateEstimate

_PRESSING = 0.15  # m that the plan is below the vehicle: more than the loops leave in the air
_CARRIED = 3.0  # m/s^2 that the accelerometer feels beyond what the rotors give; wind makes 1


class Descend(FlightMode):
    """PX4's DESCEND, which it shows as AUTO.LAND; no command begins it."""

    mode = Mode.DESCEND
    px4 = Px4Mode(4, 6, selectable=False, offered=False)

    def __init__(self, config: FlightConfig) -> None:
        super().__init__(config)
        self._body = body_of(config.planner.body, config.airframe)
        self._links = config.airframe.link_length
        self._room = stand_off(config.planner.walls)

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """Touch-down: for a while, the ground carries, or the plan sinks and the vehicle does not.

        The height is asked only while it is measured; without, the speed drifts as well.
        """
        limits = self.config.limits
        measured = state.aiding.unaided_us < limits.aiding_loss_us
        low = is_low(self.config, estimate) or not measured
        if not (low and (_carried(state, estimate) or self._presses(state, estimate))):
            return moved(state, estimate), CONTINUE
        if estimate.t_us - state.vehicle.moved_us < limits.landed_time_us:
            return state, CONTINUE
        state = replace(state, vehicle=replace(state.vehicle, landed=True))
        return state, ModeResult(Mode.DISARMED, "touched down")

    def _presses(self, state: FlightState, estimate: StateEstimate) -> bool:
        nominal = state.nominal
        sinks = abs(estimate.v_WB[2]) > 0.5 * self.config.limits.land_speed
        return not sinks and nominal is not None and nominal.p[2] - estimate.p_WB[2] > _PRESSING

    def aim(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """Where no position is measured, the place to draw back to.

        Clearances have grown by what the place is uncertain by, as far as there is room for.
        """
        safe_set, limits = state.kept.whole.safe_set, self.config.limits
        if state.aiding.unaided_us < limits.aiding_loss_us or not safe_set.zones:
            known = state.setpoint.goal is None
            return state if known else replace(state, setpoint=SetpointMemory())
        place = retreat_place(safe_set, estimate, self._body, self._links, self._room)
        goal = PositionGoal(MotionSetpoint(False, place))
        return replace(state, setpoint=SetpointMemory(goal=goal))

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        """Where it began: the planner, if there is one, is asked for the day it is needed again."""
        vehicle = state.vehicle
        return still_at(vehicle.mode_origin, t_us, vehicle.mode_yaw)


def _carried(state: FlightState, estimate: StateEstimate) -> bool:
    """Whether something holds the vehicle up that is not its rotors."""
    cascade = state.cascade
    return estimate.specific_force - sum(cascade.rotors) / cascade.mass > _CARRIED
