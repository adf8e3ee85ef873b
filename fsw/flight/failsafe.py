"""The failsafe table: what can go wrong in flight, and what the vehicle does about it.

Each row names a condition, when it is active and the action on it. A condition is reported once,
when it becomes active, and its action is taken then. Some actions are parameters, in PX4's names
and numbers. To act on another condition, add a row, and to ``FailsafeContext`` what it looks at.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final

from fsw.frozen import dataclass as value_dataclass
from fsw.parameters.flight_config import FlightLimits
from fsw.signals import BatteryState, Charge, Mode, Severity

PLAN_STALE_PERIODS: Final = 3
INVALID_TICKS: Final = 5  # 10 ms without an estimate; a single lost frame is flown through
MIN_UP: Final = 0.34  # cosine of 70 degrees of tilt


class Action(Enum):
    """What is done about a condition, from mildest to strongest."""

    NONE = "none"  # not even reported
    WARN = "warn"
    BRAKE = "brake"  # the tick does so whenever no plan is young enough
    HOLD = "holding"
    RETURN = "returning"
    LAND = "landing"
    TERMINATE = "terminate"

    @property
    def mode(self) -> Mode | None:
        """The mode that the action switches to."""
        return _MODES.get(self)


_MODES: Final = {
    Action.HOLD: Mode.HOLD,
    Action.RETURN: Mode.RETURN,
    Action.LAND: Mode.LAND,
    Action.TERMINATE: Mode.FAULT,
}


class Condition(Enum):
    """Every condition, named for what the operator reads."""

    ESTIMATE_INVALID = "state estimate invalid"
    TILT_LOST = "tilt beyond recovery"
    PLAN_STALE = "no plan for three periods"
    OUTPUT_NOT_FINITE = "actuator command not finite"
    PLAN_REFUSED = "last plan refused"
    SETPOINTS_LOST = "offboard setpoints stopped"
    DATALINK_LOST = "no ground station"
    BATTERY_LOW = "battery low"
    BATTERY_CRITICAL = "battery critical"
    BATTERY_EMERGENCY = "battery nearly empty"


@value_dataclass(frozen=True, slots=True)
class FailsafeContext:
    """What the table looks at, once a tick."""

    limits: FlightLimits
    mode: Mode
    manual_modes: frozenset[Mode]  # that an operator flies
    armed: bool
    flies: bool
    invalid_ticks: int  # since the last valid estimate
    up: float  # cosine of tilt, R33
    plan_age_us: int  # since the running plan (or take-over) began
    plan_period_us: int
    plan_refused: bool
    output_replaced: bool
    setpoint_fresh: bool  # or none is needed
    gcs_silent_us: int  # -1: no ground station was ever heard
    battery: BatteryState


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


def _on_setpoints_lost(context: FailsafeContext) -> Action:
    """COM_OBL_RC_ACT; the mode cannot continue."""
    known = {3: Action.RETURN, 4: Action.LAND, 5: Action.HOLD}
    return known.get(context.limits.setpoint_loss_action, Action.HOLD)


def _on_datalink_lost(context: FailsafeContext) -> Action:
    """NAV_DLL_ACT, where an operator flies; the other modes fly by themselves and go on."""
    if not (context.flies and context.mode in context.manual_modes):
        return Action.NONE
    known = {1: Action.HOLD, 2: Action.RETURN, 3: Action.LAND}
    return known.get(context.limits.station_loss_action, Action.NONE)


def _on_battery(context: FailsafeContext) -> Action:
    """COM_LOW_BAT_ACT: 0 warn, 2 land when critical, 3 return then and land in an emergency."""
    action = {
        (2, Charge.CRITICAL): Action.LAND,
        (2, Charge.EMERGENCY): Action.LAND,
        (3, Charge.CRITICAL): Action.RETURN,
        (3, Charge.EMERGENCY): Action.LAND,
    }.get((context.limits.low_battery_action, context.battery.charge), Action.WARN)
    under_way = context.mode is Mode.LAND or context.mode is action.mode
    return Action.WARN if under_way or not context.flies else action


def _charge_left(context: FailsafeContext) -> str:
    return f": {100.0 * context.battery.remaining:.0f} % left"


FAILSAFES: Final = (
    Failsafe(
        Condition.ESTIMATE_INVALID,
        lambda c: c.armed and c.invalid_ticks >= INVALID_TICKS,
        _always(Action.TERMINATE),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.TILT_LOST,
        lambda c: c.flies and not c.up > MIN_UP,
        _always(Action.TERMINATE),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.PLAN_STALE,
        lambda c: c.flies and c.plan_age_us > PLAN_STALE_PERIODS * c.plan_period_us,
        _always(Action.BRAKE),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.OUTPUT_NOT_FINITE,
        lambda c: c.output_replaced,
        _always(Action.WARN),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.PLAN_REFUSED,
        lambda c: c.plan_refused,
        _always(Action.WARN),
        of_vehicle=True,
    ),
    Failsafe(
        Condition.SETPOINTS_LOST,
        lambda c: not c.setpoint_fresh,
        _on_setpoints_lost,
    ),
    Failsafe(
        Condition.DATALINK_LOST,
        lambda c: c.gcs_silent_us >= c.limits.station_timeout_us,
        _on_datalink_lost,
        detail=lambda c: f" for {c.gcs_silent_us * 1e-6:.0f} s",
    ),
    Failsafe(
        Condition.BATTERY_LOW,
        lambda c: c.battery.charge is Charge.LOW,
        _on_battery,
        detail=_charge_left,
    ),
    Failsafe(
        Condition.BATTERY_CRITICAL,
        lambda c: c.battery.charge is Charge.CRITICAL,
        _on_battery,
        Severity.CRITICAL,
        _charge_left,
    ),
    Failsafe(
        Condition.BATTERY_EMERGENCY,
        lambda c: c.battery.charge is Charge.EMERGENCY,
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
