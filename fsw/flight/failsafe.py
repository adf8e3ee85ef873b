"""The failsafe table: what can go wrong in flight, and what the vehicle does about it.

Each row names a condition, when it is active and the action on it. A condition is reported once,
when it becomes active. The strongest action that any active condition asks for is taken, for as
long as no command of the pilot overrides it: that is ``failsafe_response.py``. Some actions are
parameters, in PX4's names and numbers. To act on another condition, name it and add a row;
docs/reference/failsafes.md is made from the rows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Final, NamedTuple

from fsw.estimation.sensor_fault import Sensor, sentence
from fsw.flight.uncertain_clearance import LACKING
from fsw.frozen import dataclass as value_dataclass
from fsw.parameters.flight_config import FlightConfig, FlightLimits
from fsw.signals import (
    Charge,
    Mode,
    Severity,
    SolverStatus,
    StateEstimate,
)

if TYPE_CHECKING:
    from fsw.flight.state import FlightState, LostSensor  # which keeps the active conditions

PLAN_STALE_PERIODS: Final = 3
INVALID_TICKS: Final = 5  # 10 ms without an estimate
BLIND_TICKS: Final = 125  # 0.25 s: a filter that starts anew has poses that agree long before
# Of the 500 of a second, that are too many. A gap of 50 ms, in which the rotors hold their last
# command, is 25, of which at least 12 are in the same second.
MISSED_TICKS: Final = 10
JUMP_SHOWN_US: Final = 1_000_000  # for which a jump of time is a condition
JUMP_US: Final = 500_000  # of the wall clock in a second, that is no slewing
BREAKER: Final = 121212  # of CBRK_FLIGHTTERM, PX4's number
_OFFBOARD: Final = Mode.OFFBOARD
AT_ONCE_US: Final = 2_000  # a tick
SLOW_US: Final = 100_000  # a planning period, after which the other rows are looked at again
SECOND_US: Final = 1_100_000  # the loop looks at its machine once a second
_LACKING_US: Final = 500_000  # without room enough; hidden markers, 0.2 s, are none


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
    DESCEND = "descending"  # where it is, without a plan and, if need be, without a position
    TERMINATE = "terminate"

    @property
    def mode(self) -> Mode | None:
        """The mode that the action switches to."""
        return _MODES.get(self)

    @property
    def strength(self) -> int:
        """Place in the order of actions; the stronger one wins."""
        return _STRENGTHS[self]


_MODES: Final = {
    Action.HOLD: Mode.HOLD,
    Action.RETREAT: Mode.HOLD,
    Action.RETURN: Mode.RETURN,
    Action.LAND: Mode.LAND,
    Action.DESCEND: Mode.DESCEND,
    Action.TERMINATE: Mode.FAULT,
}
_STRENGTHS: Final = {action: place for place, action in enumerate(Action)}


class Condition(Enum):
    """Every condition, named for what the operator reads."""

    ATTITUDE_LOST = "attitude unknown"
    TILT_LOST = "tilt beyond recovery"
    POSITION_LOST = "position unknown"
    PLANNER_LOST = "planner lost"
    BREACH = "outside the safe set"
    FENCE_BREACH = "outside the fence"
    ROTOR_LOST = "rotor lost"
    ROTOR_FAILED = "rotor failed"
    JOINT_FAILED = "joint failed"
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
    PLAN_LATE = "plan late"
    TIME_JUMPED = "time jumped"
    LOOP_OVERRUN = "ticks missed"
    CLOCK_JUMPED = "wall clock jumped"
    LINK_FLOODED = "link flooded"
    LOG_STOPPED = "flight log damaged"
    DISK_FULL = "disk nearly full"
    SETPOINTS_LOST = "offboard setpoints stopped"
    ZONES_SILENT = "moving zones not announced any more"
    DATALINK_LOST = "no ground station"
    FLIGHT_TIME_LOW = "flight time short"
    BATTERY_LOW = "battery low"
    BATTERY_CRITICAL = "battery critical"
    BATTERY_EMERGENCY = "battery nearly empty"
    PARAMETERS_CONTRADICT = "parameters contradict each other"


class FailsafeMemory(NamedTuple):
    """What is being done about the active conditions."""

    since_us: tuple[int, ...] = ()  # when each of them became active, in their order
    action: Action = Action.NONE  # the strongest that was taken since the pilot commanded a mode
    cause: Condition | None = None  # of that
    pending: Action = Action.NONE  # what follows the hold that gives the pilot time
    due_us: int = 0  # when
    overridden: tuple[Condition, ...] = ()  # whose actions a command of the pilot has put aside
    # As they were looked at last; another one is the same condition, and news.
    joint: str = ""  # which joints have failed
    sensors: tuple[Sensor, ...] = ()  # that are lost
    contradiction: str = ""  # of parameters


NOTHING_DONE: Final = FailsafeMemory()


@value_dataclass(frozen=True, slots=True)
class FailsafeContext:
    """What the table looks at, once a tick: all that the vehicle knows, and its limits."""

    state: FlightState
    estimate: StateEstimate
    config: FlightConfig
    against: str = ""  # which parameters contradict each other, whatever the safe set

    @property
    def limits(self) -> FlightLimits:
        """Timeouts, and the parameters of actions."""
        return self.config.limits

    @property
    def gcs_silent_us(self) -> int:
        """Time since a ground station was heard."""
        return self.estimate.t_us - self.state.vehicle.gcs_heard_us

    @property
    def contradiction(self) -> str:
        """Which parameters contradict each other, or the safe set in force; empty: none."""
        refusals = self.state.mission.refusals
        return "; ".join((self.against, *refusals) if self.against else refusals)


Evidence = Callable[[FailsafeContext], bool]


@dataclass(frozen=True, slots=True)
class Failsafe:
    """One row of the table."""

    condition: Condition
    active: Evidence
    action: Callable[[FailsafeContext], Action]
    severity: Severity = Severity.WARNING  # of a report without a change of mode
    detail: Callable[[FailsafeContext], str] = lambda _: ""  # behind the condition's name
    of_vehicle: bool = False  # a fault of the vehicle, shown by telemetry for as long as it lasts
    slow: bool = False  # looked at once a planning period, not every tick
    delayed: bool = False  # holds for COM_FAIL_ACT_T before it returns or lands
    # For the page of the table: what is looked at, how long it takes until the condition is
    # reported, beyond the time of a parameter, and the parameters that belong to it.
    detected: str = ""
    within_us: int = AT_ONCE_US
    parameters: tuple[str, ...] = ()
    does: str = ""  # the action in words where no parameter chooses it
    ends: str = ""  # when, where that is not simply when it is not so any more


def _always(action: Action) -> Callable[[FailsafeContext], Action]:
    return lambda _: action


# ---------------------------------------------------------------- what is so


def _plan_age_us(context: FailsafeContext) -> int:
    """Since the running plan began, or the vehicle was taken over."""
    return context.estimate.t_us - context.state.plan.since_us


def _plans(context: FailsafeContext) -> bool:
    """Whether a plan is being flown, or should be."""
    vehicle = context.state.vehicle
    return vehicle.flies and vehicle.mode is not Mode.DESCEND


def _plan_is_stale(context: FailsafeContext) -> bool:
    """In flight, the running plan (or taking over) began more than three periods ago."""
    stale_us = PLAN_STALE_PERIODS * context.config.planner.period_us
    return _plan_age_us(context) > stale_us and _plans(context)


def _planner_is_lost(context: FailsafeContext) -> bool:
    vehicle = context.state.vehicle
    return _plan_age_us(context) > context.limits.planner_loss_us and vehicle.flies


def _setpoints_are_lost(context: FailsafeContext) -> bool:
    vehicle = context.state.vehicle
    if Mode.OFFBOARD is not vehicle.mode and (
        Mode.OFFBOARD is not vehicle.failsafe_from
        or Condition.SETPOINTS_LOST not in vehicle.conditions
    ):
        return False
    timeout_us = context.limits.setpoint_timeout_us
    return not context.state.offboard.is_fresh(context.estimate.t_us, timeout_us)


def _datalink_is_lost(context: FailsafeContext) -> bool:
    if context.state.vehicle.gcs_heard_us < 0:
        return False  # there never was one
    return context.gcs_silent_us >= context.limits.station_timeout_us


def _lacks_room(context: FailsafeContext) -> bool:
    kept = context.state.kept
    lasts = context.estimate.t_us - kept.ample_us >= _LACKING_US
    return kept.lacking > LACKING and lasts and context.state.vehicle.flies


def _is_unaided(context: FailsafeContext) -> bool:
    aiding = context.state.aiding
    return aiding.unaided_us >= context.limits.aiding_loss_us and context.state.vehicle.flies


def _is_blind(context: FailsafeContext) -> bool:
    """Nothing is known but what was known: sensors say what is not a number, for example."""
    return context.state.invalid_ticks >= BLIND_TICKS


def _attitude_is_lost(context: FailsafeContext) -> bool:
    known = context.state.aiding.attitude_sigma <= context.limits.attitude_loss
    return (not known or _is_blind(context)) and context.state.vehicle.flies


def _position_is_off(context: FailsafeContext, most: float) -> bool:
    """Positions are missing, and the estimate has drifted by more than ``most`` [m] perhaps."""
    return _is_unaided(context) and not context.state.aiding.position_sigma <= most


def lost_sensors(context: FailsafeContext) -> tuple[LostSensor, ...]:
    """Those that have been of no use for COM_SENS_LOSS_T, but for those that give the position."""
    since_us = context.estimate.t_us - context.limits.sensor_loss_us
    return tuple([one for one in context.state.aiding.lost if one.since_us <= since_us])


def _sensor_is_lost(context: FailsafeContext) -> bool:
    return bool(lost_sensors(context)) and context.state.vehicle.flies


def _tilt_is_lost(context: FailsafeContext) -> bool:
    safety = context.state.safety
    if safety.rolled_us < 0 and safety.pitched_us < 0:
        return False
    limits, now_us = context.limits, context.estimate.t_us
    over = 0 <= safety.rolled_us <= now_us - limits.roll_failure_us
    return over or 0 <= safety.pitched_us <= now_us - limits.pitch_failure_us


def way_home_s(context: FailsafeContext) -> float:
    """Time to return and land from here [s], with RTL_TIME_FACTOR and RTL_TIME_MARGIN."""
    home, limits = context.state.vehicle.home, context.limits
    if home is None:
        return 0.0
    (x, y, z), (hx, hy, hz) = context.estimate.p_WB, home.p
    cruise = context.config.steering.cruise_speed
    top = min(z, hz - limits.return_height)
    wait = max(limits.return_wait, 0.0)
    seconds = (math.hypot(x - hx, y - hy) + z - top) / cruise + wait
    seconds += max(hz - top, 0.0) / limits.land_speed
    return limits.return_time_factor * seconds + limits.return_time_margin


def _flight_time_is_short(context: FailsafeContext) -> bool:
    left = context.state.battery.time_left
    return context.state.vehicle.flies and left < way_home_s(context)


# ---------------------------------------------------------------- what is done


def _by_number(number: int) -> Action:
    """PX4's actions of GF_ACTION, COM_POS_LOW_ACT and their like; 6 is Pandion's own."""
    return {
        0: Action.NONE,
        2: Action.HOLD,
        3: Action.RETURN,
        4: Action.TERMINATE,
        5: Action.LAND,
        6: Action.RETREAT,
    }.get(number, Action.WARN)


def _on_setpoints_lost(context: FailsafeContext) -> Action:
    """COM_OBL_RC_ACT; the mode cannot continue."""
    known = {3: Action.RETURN, 4: Action.LAND, 5: Action.HOLD, 6: Action.TERMINATE}
    return known.get(context.limits.setpoint_loss_action, Action.HOLD)


# Bits of COM_DLL_EXCEPT, PX4's; that of external modes is the one of its COM_RCL_EXCEPT.
_EXCEPTIONS: Final = {
    Mode.MISSION: 1,
    Mode.HOLD: 2,
    Mode.TAKEOFF: 2,
    Mode.OFFBOARD: 4,
    Mode.TRAJECTORY: 8,
}


def _on_datalink_lost(context: FailsafeContext) -> Action:
    """NAV_DLL_ACT, but for the modes of COM_DLL_EXCEPT."""
    vehicle, limits = context.state.vehicle, context.limits
    flown = vehicle.failsafe_from or vehicle.mode  # the hold of a failsafe is no hold of a pilot's
    excepted = _EXCEPTIONS.get(flown, 0) & limits.station_loss_exceptions
    if not vehicle.flies or excepted:
        return Action.NONE
    known = {1: Action.HOLD, 2: Action.RETURN, 3: Action.LAND, 5: Action.TERMINATE}
    return known.get(limits.station_loss_action, Action.WARN)


def _on_battery(context: FailsafeContext) -> Action:
    """COM_LOW_BAT_ACT: 0 warn, 2 land when critical, 3 return then and land in an emergency."""
    return {
        (2, Charge.CRITICAL): Action.LAND,
        (2, Charge.EMERGENCY): Action.LAND,
        (3, Charge.CRITICAL): Action.RETURN,
        (3, Charge.EMERGENCY): Action.LAND,
    }.get((context.limits.low_battery_action, context.state.battery.charge), Action.WARN)


def _on_breach(context: FailsafeContext, number: int) -> Action:
    """The action where the controller has barriers that promise not to get there."""
    config = context.config
    if config.controller != "blf" or config.soft:
        return Action.WARN
    return _by_number(number)


def _on_tilt_lost(context: FailsafeContext) -> Action:
    broken = context.limits.termination_breaker == BREAKER
    return Action.WARN if broken else Action.TERMINATE


def _on_rotor_lost(context: FailsafeContext) -> Action:
    broken = context.limits.termination_breaker == BREAKER
    return Action.LAND if broken else Action.TERMINATE


def _on_rotor_failed(context: FailsafeContext) -> Action:
    """COM_ACT_FAIL_ACT, and land at least where the heading cannot be held."""
    action = _on_actuator_failure(context)
    if action is Action.WARN or not context.state.damage.severe:
        return action
    return action if action.strength > Action.LAND.strength else Action.LAND


def _on_actuator_failure(context: FailsafeContext) -> Action:
    """COM_ACT_FAIL_ACT, PX4's numbers."""
    known = {1: Action.HOLD, 2: Action.LAND, 3: Action.RETURN, 4: Action.TERMINATE}
    return known.get(context.limits.actuator_failure_action, Action.WARN)


# ---------------------------------------------------------------- what is said of it


def _uncertain(context: FailsafeContext) -> str:
    return f" by {1e3 * context.state.aiding.position_sigma:.0f} mm{_unaided(context)}"


def _unaided(context: FailsafeContext) -> str:
    aiding = context.state.aiding
    return f": {sentence(aiding.pose, aiding.pose_fault)}, for {1e-6 * aiding.unaided_us:.2f} s"


def _lost_sensor(context: FailsafeContext) -> str:
    now_us = context.estimate.t_us
    return f": {'; '.join([one.sentence(now_us) for one in lost_sensors(context)])}"


def _charge_left(context: FailsafeContext) -> str:
    return f": {100.0 * context.state.battery.remaining:.0f} % left"


def _time_left(context: FailsafeContext) -> str:
    left = context.state.battery.time_left
    return f": {left:.0f} s left, {way_home_s(context):.0f} s needed for the way home"


def _tilted(context: FailsafeContext) -> str:
    safety, limits = context.state.safety, context.limits
    rolled = safety.rolled_us >= 0
    since_us = safety.rolled_us if rolled else safety.pitched_us
    angle = limits.roll_failure if rolled else limits.pitch_failure
    seconds = 1e-6 * (context.estimate.t_us - since_us)
    return (
        f": {'roll' if rolled else 'pitch'} above {math.degrees(angle):.0f} deg for {seconds:.2f} s"
    )


_PLANNER_FAILS: Final = {
    SolverStatus.INFEASIBLE: "infeasible",
    SolverStatus.TIME_LIMIT: "out of time",
    SolverStatus.NUMERICAL_ERROR: "numerical error",
    SolverStatus.INPUT_REFUSED: "input refused",
}


def _no_plan(context: FailsafeContext) -> str:
    """What the planner does instead of planning, and since when."""
    plan = context.state.plan
    why = "silent" if plan.awaited_missed or not plan.refused else ""
    why = why or _PLANNER_FAILS.get(plan.status, "failing")
    return f": planner {why}, last plan {1e-6 * _plan_age_us(context):.2f} s ago"


def _refused_plan(context: FailsafeContext) -> str:
    """Without a number: it may come and go ten times a second, and is then told once in a while."""
    return f": {_PLANNER_FAILS.get(context.state.plan.status, 'failing')}"


def _jumped(context: FailsafeContext) -> str:
    jump_us = context.state.safety.jump_us
    if abs(jump_us) < 100_000:
        return f" by {1e-3 * jump_us:+g} ms"
    return f" by {1e-6 * jump_us:+.2f} s"


def _by_mm(length: float) -> str:
    return f" by {1e3 * length:.0f} mm"


def _for(context: FailsafeContext, since_us: int) -> str:
    return f", for {1e-6 * (context.estimate.t_us - since_us):.2f} s"


_SLOWLY: Final = SLOW_US + AT_ONCE_US
_TWICE: Final = 2 * SLOW_US + AT_ONCE_US  # found in a planning tick, looked at up to a period later

FAILSAFES: Final = (
    Failsafe(
        Condition.ATTITUDE_LOST,
        _attitude_is_lost,
        _always(Action.TERMINATE),
        Severity.EMERGENCY,
        lambda c: ": no estimate for 0.25 s" if _is_blind(c) else _unaided(c),
        of_vehicle=True,
        detected="in flight, the standard deviation of roll or pitch is above `COM_ATT_LOSS`, or "
        "there has been no estimate at all for 125 ticks (0.25 s)",
        within_us=_SLOWLY,
        parameters=("COM_ATT_LOSS",),
        does="terminate: rotors and joints off",
    ),
    Failsafe(
        Condition.TILT_LOST,
        _tilt_is_lost,
        _on_tilt_lost,
        Severity.EMERGENCY,
        _tilted,
        of_vehicle=True,
        detected="in flight, roll has been above `FD_FAIL_R` for `FD_FAIL_R_TTRI`, or pitch above "
        "`FD_FAIL_P` for `FD_FAIL_P_TTRI`",
        parameters=(
            *("FD_FAIL_R", "FD_FAIL_R_TTRI", "FD_FAIL_P", "FD_FAIL_P_TTRI"),
            "CBRK_FLIGHTTERM",
        ),
        does="terminate: rotors and joints off; with `CBRK_FLIGHTTERM` 121212 warn",
    ),
    Failsafe(
        Condition.POSITION_LOST,
        lambda c: _position_is_off(c, c.limits.position_lost),
        _always(Action.DESCEND),
        Severity.CRITICAL,
        _uncertain,
        of_vehicle=True,
        detected="in flight, no position could be used for `COM_AID_LOSS_T`, and the standard "
        "deviation of the position is above `COM_POS_FS_EPH`",
        within_us=_SLOWLY,
        parameters=("COM_AID_LOSS_T", "COM_POS_FS_EPH"),
        does="descend by attitude and height, away from zones while the speed is known",
    ),
    Failsafe(
        Condition.PLANNER_LOST,
        _planner_is_lost,
        _always(Action.DESCEND),
        Severity.CRITICAL,
        _no_plan,
        of_vehicle=True,
        slow=True,
        detected="in flight, no plan has begun for `COM_PLN_LOSS_T`: the planner is dead, silent "
        "or finds none",
        within_us=_SLOWLY,
        parameters=("COM_PLN_LOSS_T",),
        does="descend where it is, without plans",
    ),
    Failsafe(
        Condition.BREACH,
        lambda c: c.state.safety.breach_us >= 0,
        lambda c: _on_breach(c, c.limits.breach_action),
        Severity.CRITICAL,
        detail=lambda c: _by_mm(c.state.safety.breach_by),
        of_vehicle=True,
        detected="in flight, a margin of a part of the vehicle to a zone that was announced is "
        "negative by its own estimate: "
        "each tick for hull, rotors, feet and arm ends near a zone, each planning period for "
        "everything",
        within_us=_SLOWLY,
        parameters=("SAFE_BREACH_ACT",),
        ends="every such margin has been above 10 mm for 0.5 s",
    ),
    Failsafe(
        Condition.FENCE_BREACH,
        lambda c: c.state.safety.fence_us >= 0,
        lambda c: _on_breach(c, c.limits.fence_action),
        Severity.CRITICAL,
        detail=lambda c: _by_mm(c.state.safety.fence_by),
        of_vehicle=True,
        detected="the same to a zone of an uploaded fence",
        within_us=_SLOWLY,
        parameters=("GF_ACTION",),
        ends="every such margin has been above 10 mm for 0.5 s",
    ),
    Failsafe(
        Condition.ROTOR_LOST,
        lambda c: c.state.damage.report.lost and c.state.vehicle.flies,
        _on_rotor_lost,
        Severity.EMERGENCY,
        detail=lambda c: f": {c.state.damage.rotor}{_for(c, c.state.damage.rotor_us)}",
        of_vehicle=True,
        detected="in flight, a rotor has given less than a fifth of its command for 0.15 s: 0.28 s "
        "after it was lost",
        parameters=("FD_ACT_EN", "CBRK_FLIGHTTERM"),
        does="terminate: the others cannot hold the vehicle upright "
        "([what is left](../concepts/failsafes.md#a-rotor-that-is-lost)); with `CBRK_FLIGHTTERM` "
        "121212 land",
        ends="never in a flight",
    ),
    Failsafe(
        Condition.ROTOR_FAILED,
        lambda c: bool(c.state.damage.rotor) and c.state.vehicle.flies,
        _on_rotor_failed,
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.damage.rotor}{_for(c, c.state.damage.rotor_us)}",
        of_vehicle=True,
        slow=True,
        detected="in flight, a rotor gives another thrust than it is commanded, by 1.5 N for "
        "0.15 s, or by 4 N for 0.03 s: 0.1 s after it was lost, 0.3 s after it gives 70 %, "
        "0.5 to 2 s after it gives random thrusts",
        within_us=_SLOWLY,
        parameters=("FD_ACT_EN", "COM_ACT_FAIL_ACT", "CA_FAILURE_MODE"),
        ends="a weak rotor gives what it is commanded for 3 s; another failure never ends",
    ),
    Failsafe(
        Condition.JOINT_FAILED,
        lambda c: bool(c.state.damage.joint) and c.state.vehicle.flies,
        _on_actuator_failure,
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.damage.joint}{_for(c, c.state.damage.joint_us)}",
        of_vehicle=True,
        slow=True,
        detected="in flight, for 0.1 s, torque has no effect on a joint that does not follow its "
        "reference: 0.12 N m, and half of what is asked for",
        within_us=_SLOWLY,
        parameters=("FD_ACT_EN", "COM_ACT_FAIL_ACT"),
        ends="never in a flight",
    ),
    Failsafe(
        Condition.POSITION_LOW,
        lambda c: _position_is_off(c, c.limits.position_low),
        lambda c: _by_number(c.limits.position_low_action),
        Severity.CRITICAL,
        _uncertain,
        of_vehicle=True,
        detected="in flight, no position could be used for `COM_AID_LOSS_T`, and the standard "
        "deviation of the position is above `COM_POS_LOW_EPH`",
        within_us=_SLOWLY,
        parameters=("COM_AID_LOSS_T", "COM_POS_LOW_EPH", "COM_POS_LOW_ACT"),
    ),
    Failsafe(
        Condition.SENSOR_LOST,
        _sensor_is_lost,
        lambda c: _by_number(c.limits.sensor_loss_action),
        Severity.CRITICAL,
        _lost_sensor,
        of_vehicle=True,
        detected="in flight, inertial unit or joint encoders were of no use for `COM_SENS_LOSS_T`",
        within_us=_SLOWLY,
        parameters=("COM_SENS_LOSS_T", "COM_SENS_ACT"),
    ),
    Failsafe(
        Condition.ROOM_LACKING,
        _lacks_room,
        _always(Action.WARN),
        Severity.CRITICAL,
        detail=lambda c: f": {1e3 * c.state.kept.lacking:.0f} mm less than SAFE_SIGMAS asks for",
        slow=True,
        detected="in flight, for 0.5 s, walls leave 10 mm less than clearances should grow by "
        "([barriers](../concepts/barriers.md#an-uncertain-place))",
        within_us=_TWICE,
        parameters=("SAFE_SIGMAS",),
        does="critical text; they grow as far as a plan at rest still has a place",
    ),
    Failsafe(
        Condition.TUBE_LEFT,
        lambda c: c.state.safety.off_plan_us >= 0,
        _always(Action.REPLAN),
        Severity.CRITICAL,
        detail=lambda c: _by_mm(c.state.safety.off_plan_by),
        of_vehicle=True,
        detected="in flight, the base is further from the running plan's state, on any axis, than "
        "the start-up analysis bounds it, and 10 mm for noise, or what the analysis of the "
        "estimate finds if that is more",
        within_us=2 * AT_ONCE_US,
        does="the next plan, within a planning period, starts from the measurement",
        ends="the vehicle has been within half of that for 0.5 s",
    ),
    Failsafe(
        Condition.FILTER_ACTIVE,
        lambda c: c.state.safety.filter_us >= 0,
        _always(Action.PUSH),
        Severity.CRITICAL,
        of_vehicle=True,
        detected="the safety filter changed the acceleration that the loops were about to realise",
        within_us=2 * AT_ONCE_US,
        does="the filter works in every tick that needs it",
        ends="it has changed nothing for 1 s",
    ),
    Failsafe(
        Condition.PLAN_STALE,
        _plan_is_stale,
        _always(Action.BRAKE),
        detail=_no_plan,
        of_vehicle=True,
        detected="in flight, the running plan is older than 0.3 s",
        does="brake to rest and hold, while the planner is asked again",
    ),
    Failsafe(
        Condition.AIDING_LOST,
        _is_unaided,
        _always(Action.DEAD_RECKON),
        detail=_unaided,
        of_vehicle=True,
        detected="in flight, the estimate could use no position for `COM_AID_LOSS_T`",
        within_us=_SLOWLY,
        parameters=("COM_AID_LOSS_T",),
        does="dead reckoning",
    ),
    Failsafe(
        Condition.ESTIMATE_INVALID,
        lambda c: c.state.invalid_ticks >= INVALID_TICKS,
        _always(Action.WARN),
        of_vehicle=True,
        detected="on the ground, no estimate for 5 ticks (10 ms), or for 1 s after the start",
        does="warning, at the start with the sensors that have never come; no arming. Telemetry "
        "goes on and shows it",
    ),
    Failsafe(
        Condition.OUTPUT_NOT_FINITE,
        lambda c: c.state.output_replaced,
        _always(Action.WARN),
        of_vehicle=True,
        detected="the safety gate found NaN or infinity in what the loops command",
        within_us=2 * AT_ONCE_US,
        does="warning; the last finite command is repeated",
    ),
    Failsafe(
        Condition.PLAN_REFUSED,
        lambda c: c.state.plan.refused,
        _always(Action.WARN),
        detail=_refused_plan,
        of_vehicle=True,
        detected="the planner answered that it has no plan",
        within_us=2 * AT_ONCE_US,
        does="warning; the previous plan continues",
    ),
    Failsafe(
        Condition.PLAN_LATE,
        # In every tick: a plan may come before the next look, and would have been late in silence.
        lambda c: c.state.plan.awaited_missed and _plans(c),
        _always(Action.WARN),
        detected="in flight, a plan has not come at its time",
        within_us=2 * AT_ONCE_US,
        does="warning; the previous plan continues",
    ),
    Failsafe(
        Condition.TIME_JUMPED,
        lambda c: (
            c.state.safety.jumped_us >= 0
            and c.estimate.t_us - c.state.safety.jumped_us < JUMP_SHOWN_US
        ),
        _always(Action.WARN),
        Severity.CRITICAL,
        _jumped,
        slow=True,
        detected="the sensors' clock went back, or the time stamp of the sensors went on by more "
        "ticks at once than are made up for (25, 50 ms)",
        within_us=_SLOWLY,
        does="critical text; where the clock alone jumped, the vehicle's time goes on evenly",
        ends="a second later",
    ),
    Failsafe(
        Condition.LOOP_OVERRUN,
        lambda c: c.state.host.missed_ticks >= MISSED_TICKS,
        _always(Action.WARN),
        detail=lambda c: f": {c.state.host.missed_ticks} in the last second",
        slow=True,
        detected="10 of a second's 500 ticks were late, skipped or without readings of their own",
        within_us=SECOND_US,
        does="warning; plans and estimate carry over missed ticks",
    ),
    Failsafe(
        Condition.CLOCK_JUMPED,
        lambda c: abs(c.state.host.clock_jump_us) >= JUMP_US,
        _always(Action.WARN),
        detail=lambda c: f" by {1e-6 * c.state.host.clock_jump_us:+.1f} s",
        slow=True,
        detected="within a second, the machine's wall clock moved by 0.5 s against its monotonic "
        "clock",
        within_us=SECOND_US,
        does="warning; nothing that flies uses the wall clock",
    ),
    Failsafe(
        Condition.LINK_FLOODED,
        lambda c: c.state.host.datagrams > c.limits.flood_rate,
        _always(Action.WARN),
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.host.datagrams} datagrams in the last second",
        slow=True,
        detected="more than `COM_FLOOD_RATE` datagrams a second came from the ground",
        within_us=SECOND_US,
        parameters=("COM_FLOOD_RATE",),
        does="critical text; what is read of a link in a tick is bounded, the rest is dropped",
    ),
    Failsafe(
        Condition.LOG_STOPPED,
        lambda c: bool(c.state.host.log_failure),
        _always(Action.WARN),
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.host.log_failure}",
        slow=True,
        detected="a file of the flight log could not be written, was deleted, or has gaps",
        within_us=SECOND_US,
        parameters=("COM_ARM_SDCARD",),
        does="critical text; the flight goes on, and the next arming is denied",
    ),
    Failsafe(
        Condition.DISK_FULL,
        lambda c: c.state.host.disk_left_us >= 0,
        _always(Action.WARN),
        Severity.CRITICAL,
        detail=lambda c: f": room for {1e-6 * c.state.host.disk_left_us:.0f} s of the flight log",
        slow=True,
        detected="the disk has room for less than a minute of the flight log",
        within_us=SECOND_US,
        does="critical text",
    ),
    Failsafe(
        Condition.SETPOINTS_LOST,
        _setpoints_are_lost,
        _on_setpoints_lost,
        detected="in Offboard, no setpoint for `COM_OF_LOSS_T`",
        parameters=("COM_OF_LOSS_T", "COM_OBL_RC_ACT"),
        ends="setpoints come again, or the pilot commands a mode",
    ),
    Failsafe(
        Condition.ZONES_SILENT,
        lambda c: c.state.mission.silent_zones > 0,
        _always(Action.WARN),  # a place to go to is not known: nothing is known of the zone
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.mission.silent_zones} held where predicted",
        slow=True,
        detected="a zone that moves was not announced for `SAFE_MOVE_T`",
        within_us=_TWICE,
        parameters=("SAFE_MOVE_T",),
        does="critical text; the zone stands where it is predicted then",
        ends="it is announced again",
    ),
    Failsafe(
        Condition.DATALINK_LOST,
        _datalink_is_lost,
        _on_datalink_lost,
        detail=lambda c: f" for {c.gcs_silent_us * 1e-6:.0f} s",
        slow=True,
        delayed=True,
        detected="a HEARTBEAT of a ground station (MAV_TYPE_GCS) was received, then none for "
        "`COM_DL_LOSS_T`; acted upon in every flight mode, in a mission too, but for the modes of "
        "`COM_DLL_EXCEPT`, and as soon as such a mode is left",
        within_us=_SLOWLY,
        parameters=("COM_DL_LOSS_T", "NAV_DLL_ACT", "COM_DLL_EXCEPT", "COM_FAIL_ACT_T"),
        ends="a HEARTBEAT is received",
    ),
    Failsafe(
        Condition.FLIGHT_TIME_LOW,
        _flight_time_is_short,
        lambda c: _by_number(c.limits.flight_time_action),
        detail=_time_left,
        slow=True,
        delayed=True,
        detected="in flight, what is left of the battery lasts, at the current of the last half "
        "minute, no longer than the way home takes: `RTL_TIME_FACTOR` times the time of it, and "
        "`RTL_TIME_MARGIN`",
        within_us=_TWICE,
        parameters=(
            *("RTL_TIME_FACTOR", "RTL_TIME_MARGIN", "COM_FLTT_LOW_ACT"),
            "COM_FAIL_ACT_T",
        ),
    ),
    Failsafe(
        Condition.BATTERY_LOW,
        lambda c: c.state.battery.charge is Charge.LOW,
        _on_battery,
        detail=_charge_left,
        slow=True,
        detected="the charge is below `BAT_LOW_THR`",
        within_us=_TWICE,
        parameters=("BAT_LOW_THR",),
        does="warning",
        ends="the next level",
    ),
    Failsafe(
        Condition.BATTERY_CRITICAL,
        lambda c: c.state.battery.charge is Charge.CRITICAL,
        _on_battery,
        Severity.CRITICAL,
        _charge_left,
        slow=True,
        delayed=True,
        detected="the charge is below `BAT_CRIT_THR`",
        within_us=_TWICE,
        parameters=("BAT_CRIT_THR", "COM_LOW_BAT_ACT", "COM_FAIL_ACT_T"),
        ends="the next level",
    ),
    Failsafe(
        Condition.BATTERY_EMERGENCY,
        lambda c: c.state.battery.charge is Charge.EMERGENCY,
        _on_battery,
        Severity.EMERGENCY,
        _charge_left,
        slow=True,
        delayed=True,
        detected="the charge is below `BAT_EMERGEN_THR`",
        within_us=_TWICE,
        parameters=("BAT_EMERGEN_THR", "COM_LOW_BAT_ACT", "COM_FAIL_ACT_T"),
        ends="never in a flight",
    ),
    Failsafe(
        Condition.PARAMETERS_CONTRADICT,
        lambda c: bool(c.contradiction),
        _always(Action.WARN),
        detail=lambda c: f": {c.contradiction}",
        slow=True,
        detected="two parameters contradict each other (`fsw/parameters/contradictions.py`), or "
        "the start-up analysis finds that with these parameters the safe set in force cannot be "
        "kept; with `--allow-inconsistent` that is reported when the safe set comes, and is no "
        "condition",
        within_us=_SLOWLY,
        does="warning, again when it is another contradiction; no arming. A change that would "
        "bring one about is refused, in the air at least",
        ends="the parameters or the safe set have been changed",
    ),
)

ROWS: Final = {row.condition: row for row in FAILSAFES}
FAULTS: Final = frozenset(row.condition for row in FAILSAFES if row.of_vehicle)
BLOCKING: Final = frozenset((Condition.POSITION_LOST, Condition.PLANNER_LOST))
"""While one of these is active nothing but Descend can be flown."""

_TESTS: Final = tuple((row.active, row) for row in FAILSAFES)
_QUICK: Final = tuple((row.active, row) for row in FAILSAFES if not row.slow)
# What ``all_is_well`` rules out. A row that is not here is asked in every tick.
_RULED_OUT: Final = frozenset(
    {
        Condition.ATTITUDE_LOST,
        Condition.TILT_LOST,
        Condition.POSITION_LOST,
        Condition.BREACH,
        Condition.FENCE_BREACH,
        Condition.ROTOR_LOST,
        Condition.POSITION_LOW,
        Condition.SENSOR_LOST,
        Condition.TUBE_LEFT,
        Condition.FILTER_ACTIVE,
        Condition.PLAN_STALE,
        Condition.AIDING_LOST,
        Condition.ESTIMATE_INVALID,
        Condition.OUTPUT_NOT_FINITE,
        Condition.PLAN_REFUSED,
        Condition.PLAN_LATE,
        Condition.SETPOINTS_LOST,
    }
)
_OTHERS: Final = tuple(one for one in _TESTS if one[1].condition not in _RULED_OUT)
_QUICK_OTHERS: Final = tuple(one for one in _QUICK if one[1].condition not in _RULED_OUT)
_SLOW: Final = frozenset(row.condition for row in FAILSAFES if row.slow)


def active(context: FailsafeContext) -> tuple[Failsafe, ...]:
    """Rows whose condition is active, in the order of the table; almost always none."""
    well = all_is_well(context.state, context.estimate, context.config)
    return _found(context, _OTHERS if well else _TESTS)


def quickly_active(context: FailsafeContext) -> tuple[Failsafe, ...]:
    """The same between two planning periods: the slow rows are as they were found last."""
    well = all_is_well(context.state, context.estimate, context.config)
    found = _found(context, _QUICK_OTHERS if well else _QUICK)
    before = context.state.vehicle.conditions
    if before and not _SLOW.isdisjoint(before):
        known = {row.condition for row in found} | _SLOW.intersection(before)
        found = tuple([row for row in FAILSAFES if row.condition in known])
    return found


def surely_none(state: FlightState, estimate: StateEstimate, config: FlightConfig) -> bool:
    """Whether none can be active between two planning periods, known without asking any row."""
    return (
        not state.vehicle.conditions and not _QUICK_OTHERS and all_is_well(state, estimate, config)
    )


def all_is_well(state: FlightState, estimate: StateEstimate, config: FlightConfig) -> bool:
    """Whether no condition of ``_RULED_OUT`` can be active, as in nearly every tick.

    False says nothing: the rows decide. Tests hold it against each of them.
    """
    vehicle, limits, aiding = state.vehicle, config.limits, state.aiding
    safety, plan = state.safety, state.plan
    plan_age_us = estimate.t_us - plan.since_us
    return (
        aiding.unaided_us < limits.aiding_loss_us
        and not aiding.lost
        and aiding.attitude_sigma <= limits.attitude_loss
        and safety.rolled_us < 0
        and safety.pitched_us < 0
        and safety.breach_us < 0
        and safety.fence_us < 0
        and safety.off_plan_us < 0
        and safety.filter_us < 0
        and not state.damage.report.lost
        and plan_age_us <= PLAN_STALE_PERIODS * config.planner.period_us
        and not plan.refused
        and not plan.awaited_missed
        and state.invalid_ticks < INVALID_TICKS
        and not state.output_replaced
        and vehicle.mode is not _OFFBOARD
        and vehicle.failsafe_from is not _OFFBOARD
    )


def _found(
    context: FailsafeContext, tests: tuple[tuple[Evidence, Failsafe], ...]
) -> tuple[Failsafe, ...]:
    found: tuple[Failsafe, ...] = ()
    for is_active, row in tests:
        if is_active(context):
            found = (*found, row)
    return found
