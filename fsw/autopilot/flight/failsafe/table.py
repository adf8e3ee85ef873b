"""The failsafe table: when a condition is active, and what the vehicle does about it.

A condition is reported once, when it becomes active. The strongest action that any active condition
asks for is taken, for as long as no command of the pilot overrides it: that is
``response.py``. Some actions are parameters, in PX4's names and numbers. To act on another
condition, name it in ``conditions.py`` and add a row; docs/reference/failsafes.md is made from the
rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from fsw.autopilot.estimation.redundancy import UNDECIDED
from fsw.autopilot.flight.failsafe import actions as actions
from fsw.autopilot.flight.failsafe import evidence as evidence
from fsw.autopilot.flight.failsafe import wording as wording
from fsw.autopilot.flight.failsafe.conditions import Action, Condition
from fsw.autopilot.flight.failsafe.evidence import FailsafeContext
from fsw.autopilot.flight.safety.zone_room import is_deep
from fsw.autopilot.periods import PLANNING_US, TICK_US
from fsw.autopilot.signals import Charge, Severity

AT_ONCE_US: Final = TICK_US
SLOW_US: Final = PLANNING_US  # after which the other rows are looked at again
SECOND_US: Final = 1_100_000  # the loop looks at its machine once a second

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


_SLOWLY: Final = SLOW_US + AT_ONCE_US
_TWICE: Final = 2 * SLOW_US + AT_ONCE_US  # found in a planning tick, looked at up to a period later

FAILSAFES: Final = (
    Failsafe(
        Condition.ATTITUDE_LOST,
        evidence.attitude_is_lost,
        _always(Action.TERMINATE),
        Severity.EMERGENCY,
        lambda c: ": no estimate for 0.25 s" if evidence.is_blind(c) else wording.unaided(c),
        of_vehicle=True,
        detected="in flight, the standard deviation of roll or pitch is above `COM_ATT_LOSS`, or "
        "there has been no estimate at all for 125 ticks (0.25 s)",
        within_us=_SLOWLY,
        parameters=("COM_ATT_LOSS",),
        does="terminate: rotors and joints off",
    ),
    Failsafe(
        Condition.TILT_LOST,
        evidence.tilt_is_lost,
        actions.on_tilt_lost,
        Severity.EMERGENCY,
        wording.tilted,
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
        lambda c: evidence.position_is_off(c, c.limits.position_lost),
        _always(Action.DESCEND),
        Severity.CRITICAL,
        wording.uncertain,
        of_vehicle=True,
        detected="in flight, no position could be used for `COM_AID_LOSS_T`, and the standard "
        "deviation of the position is above `COM_POS_FS_EPH`",
        within_us=_SLOWLY,
        parameters=("COM_AID_LOSS_T", "COM_POS_FS_EPH"),
        does="descend by attitude and height, away from zones while the speed is known",
    ),
    Failsafe(
        Condition.PLANNER_LOST,
        evidence.planner_is_lost,
        _always(Action.DESCEND),
        Severity.CRITICAL,
        wording.no_plan,
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
        lambda c: actions.on_breach(c, c.limits.breach_action),
        Severity.CRITICAL,
        detail=lambda c: wording.by_mm(c.state.safety.breach_by),
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
        lambda c: actions.on_breach(c, c.limits.fence_action),
        Severity.CRITICAL,
        detail=lambda c: wording.by_mm(c.state.safety.fence_by),
        of_vehicle=True,
        detected="the same to a zone of an uploaded fence",
        within_us=_SLOWLY,
        parameters=("GF_ACTION",),
        ends="every such margin has been above 10 mm for 0.5 s",
    ),
    Failsafe(
        Condition.FAR_OUTSIDE,
        lambda c: is_deep(c.state.constraints) and c.state.vehicle.flies,
        actions.on_far_outside,
        Severity.CRITICAL,
        of_vehicle=True,
        slow=True,
        delayed=True,
        detected="in flight, a margin to a zone or the fence is below -1 m",
        within_us=_TWICE,
        parameters=("SAFE_BREACH_ACT", "COM_FAIL_ACT_T"),
        does="hold, then land; only warn where `SAFE_BREACH_ACT` is 1. Nothing pushes the vehicle "
        "towards a boundary that is so far away",
    ),
    Failsafe(
        Condition.ROTOR_LOST,
        lambda c: c.state.damage.report.lost and c.state.vehicle.flies,
        actions.on_rotor_lost,
        Severity.EMERGENCY,
        detail=lambda c: f": {c.state.damage.rotor}{wording.lasting(c, c.state.damage.rotor_us)}",
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
        actions.on_rotor_failed,
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.damage.rotor}{wording.lasting(c, c.state.damage.rotor_us)}",
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
        actions.on_actuator_failure,
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.damage.joint}{wording.lasting(c, c.state.damage.joint_us)}",
        of_vehicle=True,
        slow=True,
        detected="in flight, for 0.1 s, torque has no effect on a joint that does not follow its "
        "reference: 0.12 N m, and half of what is asked for; 0.4 s while both encoders repeat "
        "themselves, which may be stuck",
        within_us=_SLOWLY,
        parameters=("FD_ACT_EN", "COM_ACT_FAIL_ACT"),
        ends="never in a flight",
    ),
    Failsafe(
        Condition.POSITION_LOW,
        lambda c: evidence.position_is_off(c, c.limits.position_low),
        lambda c: actions.by_number(c.limits.position_low_action),
        Severity.CRITICAL,
        wording.uncertain,
        of_vehicle=True,
        detected="in flight, no position could be used for `COM_AID_LOSS_T`, and the standard "
        "deviation of the position is above `COM_POS_LOW_EPH`",
        within_us=_SLOWLY,
        parameters=("COM_AID_LOSS_T", "COM_POS_LOW_EPH", "COM_POS_LOW_ACT"),
    ),
    Failsafe(
        Condition.SENSOR_LOST,
        evidence.sensor_is_lost,
        lambda c: actions.by_number(c.limits.sensor_loss_action),
        Severity.CRITICAL,
        wording.lost_sensor,
        of_vehicle=True,
        detected="in flight, inertial unit or joint encoders were of no use for `COM_SENS_LOSS_T`",
        within_us=_SLOWLY,
        parameters=("COM_SENS_LOSS_T", "COM_SENS_ACT"),
    ),
    Failsafe(
        Condition.INERTIAL_LOST,
        evidence.inertial_is_lost,
        _always(Action.DESCEND),
        Severity.CRITICAL,
        wording.lost_sensor,
        of_vehicle=True,
        slow=True,
        detected="in flight, no pose holds the attitude, and the inertial unit has been silent for "
        "`COM_SENS_LOSS_T`, or a half of it was of no use for 1 s",
        within_us=_TWICE,
        parameters=("COM_SENS_LOSS_T",),
        does="descend in a hurry, away from zones: rotors' thrusts stand in",
    ),
    Failsafe(
        Condition.SENSORS_UNDECIDED,
        lambda c: evidence.sensors_contradict(c, UNDECIDED),
        _always(Action.LAND),
        Severity.CRITICAL,
        wording.suspects,
        of_vehicle=True,
        slow=True,
        detected="in flight, the next row for 2 s",
        within_us=_TWICE,
        does="land",
    ),
    Failsafe(
        Condition.SENSORS_CONTRADICT,
        lambda c: evidence.sensors_contradict(c, 0.1),
        _always(Action.RETREAT),
        Severity.CRITICAL,
        wording.suspects,
        of_vehicle=True,
        slow=True,
        detected="in flight, for 0.1 s, gyro, accelerometer, pose, satellites or magnetometer say "
        "another motion than the others, and which of them is wrong is not known "
        "([who is wrong](safety-manual.md#who-is-wrong))",
        within_us=_TWICE,
        does="off the zones that are too close, then hold",
    ),
    Failsafe(
        Condition.ROOM_LACKING,
        evidence.lacks_room,
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
        detail=lambda c: wording.by_mm(c.state.safety.off_plan_by),
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
        evidence.plan_is_stale,
        _always(Action.BRAKE),
        detail=wording.no_plan,
        of_vehicle=True,
        detected="in flight, the running plan is older than 0.3 s",
        does="brake to rest and hold, while the planner is asked again",
    ),
    Failsafe(
        Condition.AIDING_LOST,
        evidence.is_unaided,
        _always(Action.DEAD_RECKON),
        detail=wording.unaided,
        of_vehicle=True,
        detected="in flight, the estimate could use no position for `COM_AID_LOSS_T`",
        within_us=_SLOWLY,
        parameters=("COM_AID_LOSS_T",),
        does="dead reckoning",
    ),
    Failsafe(
        Condition.ESTIMATE_INVALID,
        lambda c: c.state.invalid_ticks >= evidence.INVALID_TICKS,
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
        detail=wording.refused_plan,
        of_vehicle=True,
        detected="the planner answered that it has no plan",
        within_us=2 * AT_ONCE_US,
        does="warning; the previous plan continues",
    ),
    Failsafe(
        Condition.PLAN_LATE,
        # In every tick: a plan may come before the next look, and would have been late in silence.
        lambda c: c.state.plan.awaited_missed and evidence.plans(c),
        _always(Action.WARN),
        detected="in flight, a plan has not come at its time",
        within_us=2 * AT_ONCE_US,
        does="warning; the previous plan continues",
    ),
    Failsafe(
        Condition.TIME_JUMPED,
        lambda c: (
            c.state.safety.jumped_us >= 0
            and c.estimate.t_us - c.state.safety.jumped_us < evidence.JUMP_SHOWN_US
        ),
        _always(Action.WARN),
        Severity.CRITICAL,
        wording.jumped,
        slow=True,
        detected="the sensors' clock went back, or the time stamp of the sensors went on by more "
        "ticks at once than are made up for (25, 50 ms)",
        within_us=_SLOWLY,
        does="critical text; where the clock alone jumped, the vehicle's time goes on evenly",
        ends="a second later",
    ),
    Failsafe(
        Condition.LOOP_OVERRUN,
        lambda c: c.state.host.missed_ticks >= evidence.MISSED_TICKS,
        _always(Action.WARN),
        detail=lambda c: f": {c.state.host.missed_ticks} in the last second",
        slow=True,
        detected=f"10 of a second's {1_000_000 // TICK_US} ticks were late, skipped or without "
        "readings of their own",
        within_us=SECOND_US,
        does="warning; plans and estimate carry over missed ticks",
    ),
    Failsafe(
        Condition.CLOCK_JUMPED,
        lambda c: abs(c.state.host.clock_jump_us) >= evidence.JUMP_US,
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
        evidence.setpoints_are_lost,
        actions.on_setpoints_lost,
        detail=wording.refused_setpoints,
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
        evidence.datalink_is_lost,
        actions.on_datalink_lost,
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
        evidence.flight_time_is_short,
        lambda c: actions.by_number(c.limits.flight_time_action),
        detail=wording.time_left,
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
        actions.on_battery,
        detail=wording.charge_left,
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
        actions.on_battery,
        Severity.CRITICAL,
        wording.charge_left,
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
        actions.on_battery,
        Severity.EMERGENCY,
        wording.charge_left,
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
        detected="two parameters contradict each other "
        "(`fsw/autopilot/parameters/contradictions.py`), or the start-up analysis finds that with "
        "these parameters the safe set in force cannot be kept; with `--allow-inconsistent` that "
        "is reported when the safe set comes, and is no condition",
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
