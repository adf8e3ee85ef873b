"""The failsafe table: what can go wrong in flight, and what the vehicle does about it.

Each row names a condition, when it is active and the action on it. A condition is reported once,
when it becomes active, and its action is taken then. Some actions are parameters, in PX4's names
and numbers. To act on another condition, name it and add a row.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Final

from fsw.estimation.sensor_fault import sentence
from fsw.flight.uncertain_clearance import LACKING
from fsw.frozen import dataclass as value_dataclass
from fsw.parameters.flight_config import FlightConfig, FlightLimits
from fsw.signals import Charge, Mode, Severity, StateEstimate

if TYPE_CHECKING:
    from fsw.flight.state import FlightState  # which keeps the active conditions

PLAN_STALE_PERIODS: Final = 3
INVALID_TICKS: Final = 5  # 10 ms without an estimate
_LACKING_US: Final = 500_000  # without room enough; hidden markers, 0.2 s, are none
MIN_UP: Final = 0.34  # cosine of 70 degrees of tilt


class Action(Enum):
    """What is done about a condition, from mildest to strongest."""

    NONE = "none"  # not even reported
    WARN = "warn"
    REPLAN = "replanning"  # from the measurement, which the tick does by itself
    PUSH = "pushed off"  # by the safety filter, in every tick that needs it
    DEAD_RECKON = "dead reckoning"  # which the estimator does by itself
    BRAKE = "brake"  # the tick does so whenever no plan is young enough
    HOLD = "holding"
    RETREAT = "retreating"  # off the zones that are too close, then hold
    RETURN = "returning"
    LAND = "landing"
    TERMINATE = "terminate"

    @property
    def mode(self) -> Mode | None:
        """The mode that the action switches to."""
        return _MODES.get(self)


_MODES: Final = {
    Action.HOLD: Mode.HOLD,
    Action.RETREAT: Mode.HOLD,
    Action.RETURN: Mode.RETURN,
    Action.LAND: Mode.LAND,
    Action.TERMINATE: Mode.FAULT,
}


class Condition(Enum):
    """Every condition, named for what the operator reads."""

    ATTITUDE_LOST = "attitude unknown"
    TILT_LOST = "tilt beyond recovery"
    POSITION_LOST = "position unknown"
    BREACH = "outside the safe set"
    POSITION_LOW = "position uncertain"
    SENSOR_LOST = "sensor lost"
    ROOM_LACKING = "too little room for what the estimate is not sure of"
    TUBE_LEFT = "off the plan"
    FILTER_ACTIVE = "too fast towards a zone"
    PLAN_STALE = "no plan for three periods"
    AIDING_LOST = "no position is measured"
    ESTIMATE_INVALID = "state estimate invalid"
    OUTPUT_NOT_FINITE = "actuator command not finite"
    PLAN_REFUSED = "last plan refused"
    SETPOINTS_LOST = "offboard setpoints stopped"
    ZONES_SILENT = "moving zones not announced any more"
    DATALINK_LOST = "no ground station"
    BATTERY_LOW = "battery low"
    BATTERY_CRITICAL = "battery critical"
    BATTERY_EMERGENCY = "battery nearly empty"


@value_dataclass(frozen=True, slots=True)
class FailsafeContext:
    """What the table looks at, once a tick: all that the vehicle knows, and its limits."""

    state: FlightState
    estimate: StateEstimate
    config: FlightConfig
    manual_modes: frozenset[Mode]  # that an operator flies

    @property
    def limits(self) -> FlightLimits:
        """Timeouts, and the parameters of actions."""
        return self.config.limits

    @property
    def gcs_silent_us(self) -> int:
        """Time since a ground station was heard."""
        return self.estimate.t_us - self.state.vehicle.gcs_heard_us


@dataclass(frozen=True, slots=True)
class Failsafe:
    """One row of the table."""

    condition: Condition
    active: Callable[[FailsafeContext], bool]
    action: Callable[[FailsafeContext], Action]
    severity: Severity = Severity.WARNING  # of a report without a change of mode
    detail: Callable[[FailsafeContext], str] = lambda _: ""  # behind the condition's name
    of_vehicle: bool = False  # a fault of the vehicle, shown by telemetry for as long as it lasts


def _always(action: Action) -> Callable[[FailsafeContext], Action]:
    return lambda _: action


def _plan_is_stale(context: FailsafeContext) -> bool:
    """In flight, the running plan (or taking over) began more than three periods ago."""
    age_us = context.estimate.t_us - context.state.plan.since_us
    stale_us = PLAN_STALE_PERIODS * context.config.planner.period_us
    return age_us > stale_us and context.state.vehicle.flies


def _setpoints_are_lost(context: FailsafeContext) -> bool:
    state = context.state
    if state.vehicle.mode is not Mode.OFFBOARD:
        return False
    timeout_us = context.limits.setpoint_timeout_us
    return not state.offboard.is_fresh(context.estimate.t_us, timeout_us)


def _datalink_is_lost(context: FailsafeContext) -> bool:
    if context.state.vehicle.gcs_heard_us < 0:
        return False  # there never was one
    return context.gcs_silent_us >= context.limits.station_timeout_us


def _on_setpoints_lost(context: FailsafeContext) -> Action:
    """COM_OBL_RC_ACT; the mode cannot continue."""
    known = {3: Action.RETURN, 4: Action.LAND, 5: Action.HOLD}
    return known.get(context.limits.setpoint_loss_action, Action.HOLD)


def _on_datalink_lost(context: FailsafeContext) -> Action:
    """NAV_DLL_ACT, where an operator flies; the other modes fly by themselves and go on."""
    vehicle = context.state.vehicle
    if not (vehicle.flies and vehicle.mode in context.manual_modes):
        return Action.NONE
    known = {1: Action.HOLD, 2: Action.RETURN, 3: Action.LAND}
    return known.get(context.limits.station_loss_action, Action.NONE)


def _lacks_room(context: FailsafeContext) -> bool:
    kept = context.state.kept
    lasts = context.estimate.t_us - kept.ample_us >= _LACKING_US
    return kept.lacking > LACKING and lasts and context.state.vehicle.flies


def _on_battery(context: FailsafeContext) -> Action:
    """COM_LOW_BAT_ACT: 0 warn, 2 land when critical, 3 return then and land in an emergency."""
    action = {
        (2, Charge.CRITICAL): Action.LAND,
        (2, Charge.EMERGENCY): Action.LAND,
        (3, Charge.CRITICAL): Action.RETURN,
        (3, Charge.EMERGENCY): Action.LAND,
    }.get((context.limits.low_battery_action, context.state.battery.charge), Action.WARN)
    vehicle = context.state.vehicle
    under_way = vehicle.mode is Mode.LAND or vehicle.mode is action.mode
    return Action.WARN if under_way or not vehicle.flies else action


def _on_breach(context: FailsafeContext) -> Action:
    """SAFE_BREACH_ACT, where the controller has barriers that promise not to get there."""
    config, vehicle = context.config, context.state.vehicle
    if config.controller != "blf" or config.soft or vehicle.mode is Mode.LAND:
        return Action.WARN
    known = {2: Action.HOLD, 5: Action.LAND, 6: Action.RETREAT}
    return known.get(context.limits.breach_action, Action.WARN)


def _is_unaided(context: FailsafeContext) -> bool:
    aiding = context.state.aiding
    return aiding.unaided_us >= context.limits.aiding_loss_us and context.state.vehicle.flies


def _position_is_off(context: FailsafeContext, most: float) -> bool:
    """Positions are missing, and the estimate has drifted by more than ``most`` [m] perhaps."""
    return _is_unaided(context) and not context.state.aiding.position_sigma <= most


def _sensor_is_lost(context: FailsafeContext) -> bool:
    aiding, flies = context.state.aiding, context.state.vehicle.flies
    lost_us = context.estimate.t_us - aiding.since_us
    return aiding.sensor is not None and flies and lost_us >= context.limits.sensor_loss_us


def _unless_landing(context: FailsafeContext, number: int) -> Action:
    """1 warn, 2 hold, 5 land; a landing goes on."""
    wanted = {2: Action.HOLD, 5: Action.LAND}.get(number, Action.WARN)
    under_way = context.state.vehicle.mode in (Mode.LAND, wanted.mode)
    return Action.WARN if under_way else wanted


def _uncertain(context: FailsafeContext) -> str:
    return f" by {1e3 * context.state.aiding.position_sigma:.0f} mm{_unaided(context)}"


def _unaided(context: FailsafeContext) -> str:
    aiding = context.state.aiding
    return f": {sentence(aiding.pose, aiding.pose_fault)}, for {1e-6 * aiding.unaided_us:.2f} s"


def _lost_sensor(context: FailsafeContext) -> str:
    aiding = context.state.aiding
    if aiding.sensor is None:
        return ""
    seconds = 1e-6 * (context.estimate.t_us - aiding.since_us)
    return f": {sentence(aiding.sensor, aiding.fault)}, for {seconds:.2f} s"


def _charge_left(context: FailsafeContext) -> str:
    return f": {100.0 * context.state.battery.remaining:.0f} % left"


FAILSAFES: Final = (
    Failsafe(
        Condition.ATTITUDE_LOST,
        lambda c: (
            not c.state.aiding.attitude_sigma <= c.limits.attitude_loss and c.state.vehicle.flies
        ),
        _always(Action.TERMINATE),
        detail=_unaided,
        of_vehicle=True,
    ),
    Failsafe(
        Condition.TILT_LOST,
        lambda c: not c.estimate.R_WB[8] > MIN_UP and c.state.vehicle.flies,
        _always(Action.TERMINATE),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.POSITION_LOST,
        lambda c: _position_is_off(c, c.limits.position_lost),
        lambda c: _unless_landing(c, 5),
        Severity.CRITICAL,
        _uncertain,
        of_vehicle=True,
    ),
    Failsafe(
        Condition.BREACH,
        lambda c: c.state.safety.breach_us >= 0,
        _on_breach,
        Severity.CRITICAL,
        detail=lambda c: f" by {1e3 * c.state.safety.breach_by:.0f} mm",
        of_vehicle=True,
    ),
    Failsafe(
        Condition.POSITION_LOW,
        lambda c: _position_is_off(c, c.limits.position_low),
        lambda c: _unless_landing(c, c.limits.position_low_action),
        Severity.CRITICAL,
        _uncertain,
        of_vehicle=True,
    ),
    Failsafe(
        Condition.SENSOR_LOST,
        _sensor_is_lost,
        lambda c: _unless_landing(c, c.limits.sensor_loss_action),
        Severity.CRITICAL,
        _lost_sensor,
        of_vehicle=True,
    ),
    Failsafe(
        Condition.ROOM_LACKING,
        _lacks_room,
        _always(Action.WARN),
        Severity.CRITICAL,
        detail=lambda c: f": {1e3 * c.state.kept.lacking:.0f} mm less than SAFE_SIGMAS asks for",
    ),
    Failsafe(
        Condition.TUBE_LEFT,
        lambda c: c.state.safety.off_plan_us >= 0,
        _always(Action.REPLAN),
        Severity.CRITICAL,
        detail=lambda c: f" by {1e3 * c.state.safety.off_plan_by:.0f} mm",
        of_vehicle=True,
    ),
    Failsafe(
        Condition.FILTER_ACTIVE,
        lambda c: c.state.safety.filter_us >= 0,
        _always(Action.PUSH),
        Severity.CRITICAL,
        of_vehicle=True,
    ),
    Failsafe(
        Condition.PLAN_STALE,
        _plan_is_stale,
        _always(Action.BRAKE),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.AIDING_LOST,
        _is_unaided,
        _always(Action.DEAD_RECKON),
        detail=_unaided,
        of_vehicle=True,
    ),
    Failsafe(
        Condition.ESTIMATE_INVALID,
        lambda c: c.state.invalid_ticks >= INVALID_TICKS,
        _always(Action.WARN),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.OUTPUT_NOT_FINITE,
        lambda c: c.state.output_replaced,
        _always(Action.WARN),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.PLAN_REFUSED,
        lambda c: c.state.plan.refused,
        _always(Action.WARN),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.SETPOINTS_LOST,
        _setpoints_are_lost,
        _on_setpoints_lost,
    ),
    Failsafe(
        Condition.ZONES_SILENT,
        lambda c: c.state.mission.silent_zones > 0,
        _always(Action.WARN),  # a place to go to is not known: nothing is known of the zone
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.mission.silent_zones} held where predicted",
    ),
    Failsafe(
        Condition.DATALINK_LOST,
        _datalink_is_lost,
        _on_datalink_lost,
        detail=lambda c: f" for {c.gcs_silent_us * 1e-6:.0f} s",
    ),
    Failsafe(
        Condition.BATTERY_LOW,
        lambda c: c.state.battery.charge is Charge.LOW,
        _on_battery,
        detail=_charge_left,
    ),
    Failsafe(
        Condition.BATTERY_CRITICAL,
        lambda c: c.state.battery.charge is Charge.CRITICAL,
        _on_battery,
        Severity.CRITICAL,
        _charge_left,
    ),
    Failsafe(
        Condition.BATTERY_EMERGENCY,
        lambda c: c.state.battery.charge is Charge.EMERGENCY,
        _on_battery,
        Severity.EMERGENCY,
        _charge_left,
    ),
)

_TESTS: Final = tuple((row.active, row) for row in FAILSAFES)
FAULTS: Final = frozenset(row.condition for row in FAILSAFES if row.of_vehicle)
BATTERY: Final = frozenset(
    (Condition.BATTERY_LOW, Condition.BATTERY_CRITICAL, Condition.BATTERY_EMERGENCY)
)


def active(context: FailsafeContext) -> tuple[Failsafe, ...]:
    """Rows whose condition is active, strongest action first; almost always none."""
    found: tuple[Failsafe, ...] = ()
    for is_active, row in _TESTS:
        if is_active(context):
            found = (*found, row)
    return found


def report(row: Failsafe, context: FailsafeContext, action: Action) -> tuple[Severity, str]:
    """What the operator reads when a condition becomes active."""
    text = f"{row.condition.value}{row.detail(context)}"
    if action is Action.TERMINATE:
        return Severity.EMERGENCY, f"{text}: {action.value}"
    if action.mode is not None:
        return Severity.CRITICAL, f"failsafe: {text}, {action.value}"
    return row.severity, f"{text}: {action.value}" if row.of_vehicle else text
