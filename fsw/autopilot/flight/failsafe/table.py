"""The failsafe table: when a condition is active, and what the vehicle does about it.

A condition is reported once, when it becomes active. The strongest action that any active condition
asks for is taken, for as long as no command of the pilot overrides it: that is
``response.py``. Some actions are parameters, in PX4's names and numbers. To act on another
condition, name it in ``conditions.py`` and add a row; docs/reference/failsafes.md is made from the
rows and what ``docs/pages/failsafes.toml`` says of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from fsw.autopilot.estimation.faults.verdict import UNDECIDED
from fsw.autopilot.flight.commands.arming import Subject
from fsw.autopilot.flight.failsafe import actions as actions
from fsw.autopilot.flight.failsafe import evidence as evidence
from fsw.autopilot.flight.failsafe import wording as wording
from fsw.autopilot.flight.failsafe.conditions import Action, Condition
from fsw.autopilot.flight.safety.zone_room import is_deep
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.periods import PLANNING_US, TICK_US
from fsw.autopilot.signals import BatteryWarning, Severity

AT_ONCE_US: Final = TICK_US
SLOW_US: Final = PLANNING_US  # after which the other rows are looked at again
_OF_HOST_US: Final = 1_000_000 + SLOW_US  # the loop looks at its machine once a second


@dataclass(frozen=True, slots=True)
class Failsafe:
    """One row of the table."""

    condition: Condition
    active: Callable[[Situation], bool]
    asks: Action | Callable[[Situation], Action] = Action.WARN  # what is done
    severity: Severity = Severity.WARNING  # of a report without a change of mode
    detail: Callable[[Situation], str] = lambda _: ""  # behind the condition's name
    of_vehicle: bool = False  # a fault of the vehicle, shown by telemetry for as long as it lasts
    in_flight: bool = False  # none on the ground
    slow: bool = False  # looked at once a planning period, not every tick
    delayed: bool = False  # holds for COM_FAIL_ACT_T before it returns or lands
    within_us: int = AT_ONCE_US  # until it is reported, beyond the time of a parameter
    parameters: tuple[str, ...] = ()  # that belong to it
    component: Subject | None = None  # which is ill while it lasts; on the ground, checks say it
    takeover: bool = True  # the pilot can fly another mode while it acts; else Descend alone

    def action(self, context: Situation) -> Action:
        """What is done now, if it is active."""
        return self.asks if isinstance(self.asks, Action) else self.asks(context)


_SLOWLY: Final = SLOW_US + AT_ONCE_US
# What a planning tick finds, its row looks at up to a period later.
_TWICE: Final = 2 * SLOW_US + AT_ONCE_US
# What rows have in common. Faults of the vehicle are told a planning period late at most.
_fault = partial(Failsafe, of_vehicle=True, within_us=_SLOWLY)
_in_flight = partial(_fault, in_flight=True)
_of_contact = partial(
    Failsafe,
    asks=Action.RETREAT,
    severity=Severity.CRITICAL,
    in_flight=True,
    slow=True,
    within_us=_SLOWLY,
)
_of_sensors = partial(
    _in_flight,
    severity=Severity.CRITICAL,
    detail=wording.suspects,
    slow=True,
    within_us=_TWICE,
    component=Subject.SENSORS,
)
_of_battery = partial(
    Failsafe,
    asks=actions.on_battery,
    detail=lambda c: f": {100.0 * c.state.battery.remaining:.0f} % left",
    slow=True,
    within_us=_TWICE,
    component=Subject.BATTERY,
)
_of_tick = partial(Failsafe, of_vehicle=True, within_us=2 * AT_ONCE_US)
_of_host = partial(Failsafe, slow=True, within_us=_OF_HOST_US)

FAILSAFES: Final = (
    _in_flight(
        Condition.ATTITUDE_LOST,
        evidence.attitude_is_lost,
        Action.TERMINATE,
        Severity.EMERGENCY,
        lambda c: ": no estimate for 0.25 s" if evidence.is_blind(c) else wording.unaided(c),
        parameters=("COM_ATT_LOSS",),
        component=Subject.ATTITUDE,
    ),
    Failsafe(
        Condition.TILT_LOST,
        evidence.tilt_is_lost,
        actions.on_tilt_lost,
        Severity.EMERGENCY,
        wording.tilted,
        of_vehicle=True,
        parameters=(
            *("FD_FAIL_R", "FD_FAIL_R_TTRI", "FD_FAIL_P", "FD_FAIL_P_TTRI"),
            "CBRK_FLIGHTTERM",
        ),
        component=Subject.ATTITUDE,
    ),
    _in_flight(
        Condition.POSITION_LOST,
        lambda c: evidence.position_is_off(c, c.limits.position_lost),
        Action.DESCEND,
        Severity.CRITICAL,
        wording.uncertain,
        parameters=("COM_AID_LOSS_T", "COM_POS_FS_EPH"),
        component=Subject.ESTIMATOR,
        takeover=False,
    ),
    _in_flight(
        Condition.PLANNER_LOST,
        evidence.planner_is_lost,
        Action.DESCEND,
        Severity.CRITICAL,
        wording.no_plan,
        slow=True,
        parameters=("COM_PLN_LOSS_T",),
        takeover=False,
    ),
    _fault(
        Condition.BREACH,
        lambda c: c.state.safety.breach_us >= 0,
        actions.on_breach("SAFE_BREACH_ACT"),
        Severity.CRITICAL,
        detail=lambda c: wording.by_mm(c.state.safety.breach_by),
        parameters=("SAFE_BREACH_ACT",),
    ),
    _fault(
        Condition.FENCE_BREACH,
        lambda c: c.state.safety.fence_us >= 0,
        actions.on_breach("GF_ACTION"),
        Severity.CRITICAL,
        detail=lambda c: wording.by_mm(c.state.safety.fence_by),
        parameters=("GF_ACTION",),
    ),
    _in_flight(
        Condition.FAR_OUTSIDE,
        lambda c: is_deep(c.state.constraints),
        actions.on_far_outside,
        Severity.CRITICAL,
        slow=True,
        delayed=True,
        within_us=_TWICE,
        parameters=("SAFE_BREACH_ACT", "COM_FAIL_ACT_T"),
    ),
    _fault(
        Condition.GROUND_CONTACT,
        evidence.stands_on_ground,
        Action.LAND,
        Severity.CRITICAL,
        detail=wording.carried,
        slow=True,
    ),
    _in_flight(
        Condition.ROTOR_LOST,
        lambda c: c.state.damage.report.lost,
        actions.on_rotor_lost,
        Severity.EMERGENCY,
        detail=lambda c: f": {c.state.damage.rotor}{wording.lasting(c, c.state.damage.rotor_us)}",
        within_us=AT_ONCE_US,
        parameters=("FD_ACT_EN", "CBRK_FLIGHTTERM"),
        component=Subject.ACTUATORS,
    ),
    _in_flight(
        Condition.ROTOR_FAILED,
        lambda c: bool(c.state.damage.rotor) and not c.state.damage.spared,
        actions.on_rotor_failed,
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.damage.rotor}{wording.lasting(c, c.state.damage.rotor_us)}",
        slow=True,
        parameters=("FD_ACT_EN", "COM_ACT_FAIL_ACT", "CA_FAILURE_MODE"),
        component=Subject.ACTUATORS,
    ),
    _in_flight(
        Condition.JOINT_FAILED,
        lambda c: bool(c.state.damage.joint),
        actions.on_actuator_failure,
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.damage.joint}{wording.lasting(c, c.state.damage.joint_us)}",
        slow=True,
        parameters=("FD_ACT_EN", "COM_ACT_FAIL_ACT"),
        component=Subject.ACTUATORS,
    ),
    _in_flight(
        Condition.POSITION_LOW,
        evidence.position_is_disputed,
        actions.by("COM_POS_LOW_ACT"),
        Severity.CRITICAL,
        wording.uncertain,
        parameters=("COM_AID_LOSS_T", "COM_POS_LOW_EPH", "COM_POS_LOW_ACT"),
        component=Subject.ESTIMATOR,
    ),
    _in_flight(
        Condition.SENSOR_LOST,
        lambda c: bool(evidence.lost_sensors(c)),
        actions.by("COM_SENS_ACT"),
        Severity.CRITICAL,
        wording.lost_sensor,
        parameters=("COM_SENS_LOSS_T", "COM_SENS_ACT"),
        component=Subject.SENSORS,
    ),
    _of_sensors(
        Condition.INERTIAL_LOST,
        evidence.inertial_is_lost,
        Action.DESCEND,
        detail=wording.lost_sensor,
        parameters=("COM_SENS_LOSS_T",),
    ),
    _of_sensors(
        Condition.SENSORS_UNDECIDED,
        lambda c: c.state.aiding.disputed_us > 1e6 * UNDECIDED,
        Action.LAND,
    ),
    _of_sensors(
        Condition.SENSORS_CONTRADICT,
        lambda c: c.state.aiding.disputed_us > 100_000,
        Action.RETREAT,
    ),
    Failsafe(
        Condition.ROOM_LACKING,
        evidence.lacks_room,
        actions.on_lack_of_room,
        Severity.CRITICAL,
        detail=lambda c: f": {1e3 * c.state.kept.shortfall:.0f} mm less than SAFE_SIGMAS asks for",
        in_flight=True,
        slow=True,
        within_us=_TWICE,
        parameters=("SAFE_SIGMAS", "COM_AID_LOSS_T", "COM_POS_LOW_EPH"),
    ),
    _of_contact(
        Condition.FORCE_HIGH,
        evidence.presses_too_hard,
        detail=wording.force,
        of_vehicle=True,
        slow=False,
        within_us=2 * AT_ONCE_US,
    ),
    _of_contact(
        Condition.CONTACT_LOST,
        lambda c: c.state.record.pressing.lost_for > evidence.CONTACT_LOST_S,
        detail=lambda c: f" for {c.state.record.pressing.lost_for:.1f} s",
    ),
    _of_contact(
        Condition.SURFACE_MOVED,
        evidence.surface_has_moved,
        detail=lambda c: wording.by_mm(abs(c.state.record.pressing.moved)),
    ),
    _of_contact(Condition.TOOL_SLIPS, evidence.tool_slips),
    _of_contact(
        Condition.PAYLOAD_HEAVY,
        lambda c: c.state.record.payload.mass > evidence.WEIGHED * c.heaviest,
        asks=Action.LAND,
        detail=lambda c: f": {1e3 * c.state.record.payload.mass:.0f} g of {1e3 * c.heaviest:.0f} g",
        delayed=True,
        parameters=("COM_FAIL_ACT_T",),
    ),
    _of_tick(
        Condition.TUBE_LEFT,
        lambda c: c.state.safety.off_plan_us >= 0,
        Action.REPLAN,
        Severity.CRITICAL,
        detail=lambda c: wording.by_mm(c.state.safety.off_plan_by),
    ),
    _of_tick(
        Condition.FILTER_ACTIVE,
        lambda c: c.state.safety.filter_us >= 0,
        Action.PUSH,
        Severity.CRITICAL,
    ),
    _in_flight(
        Condition.PLAN_STALE,
        evidence.plan_is_stale,
        Action.BRAKE,
        detail=wording.no_plan,
        within_us=AT_ONCE_US,
    ),
    _in_flight(
        Condition.AIDING_LOST,
        evidence.is_unaided,
        Action.DEAD_RECKON,
        detail=wording.unaided,
        parameters=("COM_AID_LOSS_T",),
        component=Subject.ESTIMATOR,
    ),
    Failsafe(
        Condition.ESTIMATE_INVALID,
        lambda c: c.state.invalid_ticks >= evidence.INVALID_TICKS,
        of_vehicle=True,
        component=Subject.ESTIMATOR,
    ),
    _of_tick(
        Condition.OUTPUT_NOT_FINITE,
        lambda c: c.state.output_replaced,
        component=Subject.ACTUATORS,
    ),
    _of_tick(Condition.PLAN_REFUSED, lambda c: c.state.plan.refused, detail=wording.refused_plan),
    Failsafe(
        Condition.PLAN_LATE,
        # In every tick: a plan may come before the next look, and would have been late in silence.
        lambda c: c.state.plan.awaited_missed and evidence.plans(c),
        in_flight=True,
        within_us=2 * AT_ONCE_US,
    ),
    Failsafe(
        Condition.TIME_JUMPED,
        lambda c: (
            c.state.safety.jumped_us >= 0
            and c.estimate.t_us - c.state.safety.jumped_us < evidence.JUMP_SHOWN_US
        ),
        severity=Severity.CRITICAL,
        detail=wording.jumped,
        slow=True,
        within_us=_SLOWLY,
    ),
    _of_host(
        Condition.LOOP_OVERRUN,
        lambda c: c.state.host.missed_ticks >= evidence.MISSED_TICKS,
        detail=lambda c: f": {c.state.host.missed_ticks} in the last second",
    ),
    _of_host(
        Condition.CLOCK_JUMPED,
        lambda c: abs(c.state.host.clock_jump_us) >= evidence.JUMP_US,
        detail=lambda c: f" by {1e-6 * c.state.host.clock_jump_us:+.1f} s",
    ),
    _of_host(
        Condition.LINK_FLOODED,
        lambda c: c.state.host.datagrams > c.limits.flood_rate,
        severity=Severity.CRITICAL,
        detail=lambda c: f": {c.state.host.datagrams} datagrams in the last second",
        parameters=("COM_FLOOD_RATE",),
    ),
    _of_host(
        Condition.LOG_STOPPED,
        lambda c: bool(c.state.host.log_failure),
        severity=Severity.CRITICAL,
        detail=lambda c: f": {c.state.host.log_failure}",
        parameters=("COM_ARM_SDCARD",),
        component=Subject.STORAGE,
    ),
    _of_host(
        Condition.DISK_FULL,
        lambda c: c.state.host.disk_left_us >= 0,
        severity=Severity.CRITICAL,
        detail=lambda c: f": room for {1e-6 * c.state.host.disk_left_us:.0f} s of the flight log",
        component=Subject.STORAGE,
    ),
    Failsafe(
        Condition.SETPOINTS_LOST,
        evidence.setpoints_are_lost,
        actions.by("COM_OBL_RC_ACT"),
        detail=wording.refused_setpoints,
        parameters=("COM_OF_LOSS_T", "COM_OBL_RC_ACT"),
    ),
    Failsafe(
        Condition.ZONES_SILENT,
        lambda c: c.state.mission.silent_zones > 0,
        Action.WARN,  # a place to go to is not known: nothing is known of the zone
        Severity.CRITICAL,
        detail=lambda c: f": {c.state.mission.silent_zones} held where predicted",
        slow=True,
        within_us=_TWICE,
        parameters=("SAFE_MOVE_T",),
    ),
    Failsafe(
        Condition.DATALINK_LOST,
        evidence.datalink_is_lost,
        actions.on_datalink_lost,
        detail=lambda c: f" for {evidence.station_silent_us(c) * 1e-6:.0f} s",
        slow=True,
        delayed=True,
        within_us=_SLOWLY,
        parameters=("COM_DL_LOSS_T", "NAV_DLL_ACT", "COM_DLL_EXCEPT", "COM_FAIL_ACT_T"),
    ),
    Failsafe(
        Condition.FLIGHT_TIME_LOW,
        lambda c: c.state.battery.time_left < evidence.way_home_s(c),
        actions.by("COM_FLTT_LOW_ACT"),
        detail=wording.time_left,
        in_flight=True,
        slow=True,
        delayed=True,
        within_us=_TWICE,
        parameters=("RTL_TIME_FACTOR", "RTL_TIME_MARGIN", "COM_FLTT_LOW_ACT", "COM_FAIL_ACT_T"),
    ),
    _of_battery(
        Condition.BATTERY_LOW,
        lambda c: c.state.battery.charge is BatteryWarning.LOW,
        parameters=("BAT_LOW_THR",),
    ),
    _of_battery(
        Condition.BATTERY_CRITICAL,
        lambda c: c.state.battery.charge is BatteryWarning.CRITICAL,
        severity=Severity.CRITICAL,
        delayed=True,
        parameters=("BAT_CRIT_THR", "COM_LOW_BAT_ACT", "COM_FAIL_ACT_T"),
    ),
    _of_battery(
        Condition.BATTERY_EMERGENCY,
        lambda c: c.state.battery.charge is BatteryWarning.EMERGENCY,
        severity=Severity.EMERGENCY,
        delayed=True,
        parameters=("BAT_EMERGEN_THR", "COM_LOW_BAT_ACT", "COM_FAIL_ACT_T"),
    ),
    Failsafe(
        Condition.PARAMETERS_CONTRADICT,
        lambda c: bool(c.contradiction),
        detail=lambda c: f": {c.contradiction}",
        slow=True,
        within_us=_SLOWLY,
    ),
)


ROWS: Final = {row.condition: row for row in FAILSAFES}
FAULTS: Final = frozenset(row.condition for row in FAILSAFES if row.of_vehicle)
_QUICK: Final = tuple([row for row in FAILSAFES if not row.slow])
BLOCKING: Final = frozenset(row.condition for row in FAILSAFES if not row.takeover)


def active(context: Situation) -> tuple[Failsafe, ...]:
    """Rows whose condition is active, in the order of the table; almost always none."""
    flies = context.state.vehicle.flies
    return tuple([row for row in FAILSAFES if (flies or not row.in_flight) and row.active(context)])


def active_between(context: Situation) -> tuple[Failsafe, ...]:
    """The same between planning periods: quick rows as they are now, slow ones as found last."""
    vehicle = context.state.vehicle
    before, flies = vehicle.conditions, vehicle.flies
    found = []
    for row in FAILSAFES if before else _QUICK:
        looked_at = row.slow or flies or not row.in_flight
        if looked_at and (row.condition in before if row.slow else row.active(context)):
            found.append(row)
    return tuple(found)
