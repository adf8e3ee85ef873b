"""Which condition is active when, and what is done about it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.flight.failsafe.conditions import Action, Condition
from fsw.autopilot.flight.failsafe.evidence import way_home_s
from fsw.autopilot.flight.failsafe.response import report
from fsw.autopilot.flight.failsafe.table import FAILSAFES, FAULTS, ROWS, active, active_between
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import (
    AIDED,
    Aiding,
    Damage,
    LostSensor,
    MissionMemory,
    OffboardMemory,
    PlanMemory,
    SafetyMemory,
    VehicleMemory,
    first_state,
)
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.parameters.flight_config import FlightConfig, FlightLimits, flight_config
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.signals import (
    ActuatorReport,
    BatteryState,
    BatteryWarning,
    Home,
    HostHealth,
    Mode,
    Severity,
    SolverStatus,
)
from fsw.autopilot.tick_record import Payload, Pressing, Tick
from tests.fsw.random_states import random_estimate
from tests.fsw.records import changed

PERIOD_US = 100_000
NOW_US = 10**9
CONFIG = flight_config(body="points")
AMPLE = InflatedSafeSet(sufficient_us=NOW_US)


@dataclass(frozen=True)
class Evidence:
    """What a condition may depend on, in the words of the tests."""

    limits: FlightLimits = field(default_factory=FlightLimits)
    mode: Mode = Mode.HOLD
    landed: bool = False
    invalid_ticks: int = 0
    plan_age_us: int = PERIOD_US
    plan_refused: bool = False
    output_replaced: bool = False
    failsafe_from: Mode | None = None
    known: tuple[Condition, ...] = ()  # that were active before
    setpoint_age_us: int = 0
    gcs_silent_us: int = 0
    battery: BatteryState = field(default_factory=BatteryState)
    silent_zones: int = 0
    refusals: tuple[str, ...] = ()
    safety: SafetyMemory = field(default_factory=SafetyMemory)
    aiding: Aiding = AIDED
    kept: InflatedSafeSet = AMPLE
    config: FlightConfig = CONFIG
    host: HostHealth = field(default_factory=HostHealth)
    damage: Damage = field(default_factory=Damage)
    plan: PlanMemory = field(default_factory=PlanMemory)
    pressing: dict[str, Any] = field(default_factory=dict)
    held: float = 0.0  # kg, in the gripper

    def context(self) -> Situation:
        last_received_us = NOW_US - self.gcs_silent_us if self.gcs_silent_us >= 0 else -1
        state = replace(
            first_state(self.config.airframe),
            invalid_ticks=self.invalid_ticks,
            output_replaced=self.output_replaced,
            vehicle=VehicleMemory(
                mode=self.mode,
                landed=self.landed,
                gcs_heard_us=last_received_us,
                failsafe_from=self.failsafe_from,
                conditions=self.known,
                home=Home((0.0, 0.0, 0.0), 0.0),
            ),
            plan=replace(self.plan, since_us=NOW_US - self.plan_age_us, refused=self.plan_refused),
            offboard=OffboardMemory(motion_us=NOW_US - self.setpoint_age_us),
            battery=self.battery,
            mission=MissionMemory(silent_zones=self.silent_zones, refusals=self.refusals),
            safety=self.safety,
            aiding=self.aiding,
            host=self.host,
            damage=self.damage,
            kept=self.kept,
            record=changed(
                Tick(),
                pressing=changed(Pressing(), **self.pressing),
                payload=changed(Payload(), mass=self.held),
            ),
        )
        estimate = random_estimate(np.random.default_rng(1))._replace(t_us=NOW_US)
        return Situation(state, estimate, replace(self.config, limits=self.limits), heaviest=0.4)


FINE = Evidence()
OUTSIDE = SafetyMemory(breach_us=NOW_US, breach_by=0.0123)
OVER_THE_FENCE = SafetyMemory(fence_us=NOW_US, fence_by=0.0123)
CRAMPED = InflatedSafeSet(shortfall=0.0234, sufficient_us=NOW_US - 500_000)
OFF_PLAN = SafetyMemory(off_plan_us=NOW_US, off_plan_by=0.0834)
UNAIDED = Aiding(1_500_000, Sensor.POSE, SensorFault.STUCK)


def replaced_sensor(for_us: int) -> Aiding:
    """Something stands in for the IMU."""
    return Aiding(lost=(LostSensor(Sensor.IMU, SensorFault.STUCK, NOW_US - for_us),))


OFFBOARD = replace(FINE, mode=Mode.OFFBOARD, setpoint_age_us=500_000)


def charged(charge: BatteryWarning) -> BatteryState:
    return BatteryState(remaining=0.07, charge=charge)


def conditions(evidence: Evidence) -> tuple[Condition, ...]:
    return tuple(row.condition for row in active(evidence.context()))


def action(evidence: Evidence) -> Action:
    (row,) = active(evidence.context())
    return row.action(evidence.context())


def test_every_condition_has_one_row() -> None:
    assert [row.condition for row in FAILSAFES] == list(Condition)


@pytest.mark.requirement("REQ-EST-8")
def test_without_attitude_the_flight_is_ended_and_only_then() -> None:
    ending = {row.condition for row in FAILSAFES if row.action(FINE.context()) is Action.TERMINATE}
    assert ending == {Condition.ATTITUDE_LOST, Condition.TILT_LOST, Condition.ROTOR_LOST}


def test_nothing_wrong_is_no_condition() -> None:
    assert active(FINE.context()) == ()


@pytest.mark.requirement(
    "REQ-ARM-1",
    "REQ-ARM-7",
    "REQ-EST-3",
    "REQ-EST-8",
    "REQ-EST-9",
    "REQ-TIME-3",
    "REQ-TIME-5",
    "REQ-LINK-5",
    "REQ-BAT-1",
    "REQ-LOG-2",
)
@pytest.mark.parametrize(
    ("evidence", "condition"),
    [
        (replace(FINE, invalid_ticks=5), Condition.ESTIMATE_INVALID),
        (replace(FINE, mode=Mode.DISARMED, invalid_ticks=5), Condition.ESTIMATE_INVALID),
        (replace(FINE, aiding=Aiding(attitude_sigma=0.71)), Condition.ATTITUDE_LOST),
        (replace(FINE, aiding=Aiding(attitude_sigma=math.nan)), Condition.ATTITUDE_LOST),
        (replace(FINE, mode=Mode.DISARMED, invalid_ticks=10**6), Condition.ESTIMATE_INVALID),
        (replace(FINE, aiding=Aiding(250_000)), Condition.AIDING_LOST),
        (replace(FINE, aiding=replaced_sensor(50_000)), Condition.SENSOR_LOST),
        (replace(FINE, safety=SafetyMemory(rolled_us=NOW_US - 300_000)), Condition.TILT_LOST),
        (replace(FINE, safety=SafetyMemory(pitched_us=NOW_US - 300_000)), Condition.TILT_LOST),
        (replace(FINE, safety=OVER_THE_FENCE), Condition.FENCE_BREACH),
        (replace(FINE, safety=SafetyMemory(light_us=NOW_US - 1_000_000)), Condition.GROUND_CONTACT),
        (replace(FINE, damage=Damage(rotor="rotor 2")), Condition.ROTOR_FAILED),
        (replace(FINE, damage=Damage(joint="joint 1")), Condition.JOINT_FAILED),
        (replace(FINE, plan=PlanMemory(awaited_missed=True)), Condition.PLAN_LATE),
        (
            replace(FINE, safety=SafetyMemory(jump_us=60_000, jumped_us=NOW_US - 999_999)),
            Condition.TIME_JUMPED,
        ),
        (replace(FINE, host=HostHealth(missed_ticks=10)), Condition.LOOP_OVERRUN),
        (replace(FINE, host=HostHealth(clock_jump_us=-500_000)), Condition.CLOCK_JUMPED),
        (replace(FINE, host=HostHealth(datagrams=2001)), Condition.LINK_FLOODED),
        (replace(FINE, host=HostHealth(log_failure="flight.ulg")), Condition.LOG_STOPPED),
        (replace(FINE, host=HostHealth(disk_left_us=0)), Condition.DISK_FULL),
        (replace(FINE, battery=BatteryState(time_left=20.0)), Condition.FLIGHT_TIME_LOW),
        (replace(FINE, plan_age_us=3 * PERIOD_US + 1), Condition.PLAN_STALE),
        (replace(FINE, plan_refused=True), Condition.PLAN_REFUSED),
        (replace(FINE, output_replaced=True), Condition.OUTPUT_NOT_FINITE),
        (replace(FINE, safety=OUTSIDE), Condition.BREACH),
        (replace(FINE, safety=OFF_PLAN), Condition.TUBE_LEFT),
        (replace(FINE, kept=CRAMPED), Condition.ROOM_LACKING),
        (
            replace(FINE, pressing={"near": 1, "pressed": 4.8, "unsure": 0.3, "most": 5.0}),
            Condition.FORCE_HIGH,
        ),
        (
            replace(FINE, pressing={"near": 1, "blow": 4.8, "unsure": 0.3, "most": 5.0}),
            Condition.FORCE_HIGH,
        ),
        (replace(FINE, pressing={"near": 1, "lost_for": 1.1}), Condition.CONTACT_LOST),
        (replace(FINE, pressing={"near": 1, "moved": -0.07}), Condition.SURFACE_MOVED),
        (replace(FINE, pressing={"contact": 1, "slip": (0.3, 0.1, 0.0)}), Condition.TOOL_SLIPS),
        (replace(FINE, held=0.421), Condition.PAYLOAD_HEAVY),
        (OFFBOARD, Condition.SETPOINTS_LOST),
        (replace(FINE, silent_zones=1), Condition.ZONES_SILENT),
        (replace(FINE, gcs_silent_us=10_000_000), Condition.DATALINK_LOST),
        (replace(FINE, battery=charged(BatteryWarning.LOW)), Condition.BATTERY_LOW),
        (replace(FINE, battery=charged(BatteryWarning.CRITICAL)), Condition.BATTERY_CRITICAL),
        (replace(FINE, battery=charged(BatteryWarning.EMERGENCY)), Condition.BATTERY_EMERGENCY),
        (replace(FINE, refusals=("lambda is too large",)), Condition.PARAMETERS_CONTRADICT),
    ],
)
def test_each_evidence_is_its_condition(evidence: Evidence, condition: Condition) -> None:
    assert conditions(evidence) == (condition,)


@pytest.mark.requirement("REQ-EST-9")
@pytest.mark.parametrize(
    "evidence",
    [
        replace(FINE, invalid_ticks=4),  # a lost frame or two are flown through
        replace(FINE, safety=SafetyMemory(rolled_us=NOW_US - 299_999, pitched_us=NOW_US)),
        replace(FINE, safety=SafetyMemory(light_us=NOW_US - 999_999)),  # a fall ends before
        replace(FINE, safety=SafetyMemory(jump_us=60_000, jumped_us=NOW_US - 1_000_000)),
        replace(FINE, host=HostHealth(missed_ticks=9, clock_jump_us=499_999, datagrams=2000)),
        replace(FINE, landed=True, damage=Damage("rotor 1", joint="joint 2")),
        replace(FINE, landed=True, battery=BatteryState(time_left=1.0)),
        replace(FINE, landed=True, plan=PlanMemory(awaited_missed=True)),
        replace(FINE, plan_age_us=3 * PERIOD_US),
        replace(FINE, landed=True, plan_age_us=10**9),
        replace(FINE, aiding=Aiding(unaided_us=249_999, position_sigma=9.0)),
        replace(FINE, aiding=Aiding(position_sigma=9.0)),  # it was never known better
        replace(FINE, aiding=replaced_sensor(49_999)),
        replace(FINE, landed=True, aiding=Aiding(10**6, attitude_sigma=9.0, position_sigma=9.0)),
        replace(OFFBOARD, setpoint_age_us=499_999),
        replace(FINE, gcs_silent_us=9_999_999),
        replace(FINE, gcs_silent_us=-1),  # there never was one
    ],
)
def test_what_can_be_lived_with_is_no_condition(evidence: Evidence) -> None:
    assert active(evidence.context()) == ()


@pytest.mark.requirement("REQ-EST-8")
def test_a_vehicle_that_knows_nothing_for_a_quarter_of_a_second_terminates() -> None:
    assert conditions(replace(FINE, invalid_ticks=124)) == (Condition.ESTIMATE_INVALID,)
    blind = replace(FINE, invalid_ticks=125)
    assert conditions(blind) == (Condition.ATTITUDE_LOST, Condition.ESTIMATE_INVALID)
    row = active(blind.context())[0]
    assert row.action(blind.context()) is Action.TERMINATE
    assert row.detail(blind.context()) == ": no estimate for 0.25 s"


@pytest.mark.requirement("REQ-LINK-2")
@pytest.mark.parametrize(
    ("number", "expected"),
    [
        (0, Action.HOLD),
        (3, Action.RETURN),
        (4, Action.LAND),
        (5, Action.HOLD),
        (6, Action.TERMINATE),
    ],
)
def test_lost_setpoints_are_acted_on_as_the_parameter_says(number: int, expected: Action) -> None:
    assert action(replace(OFFBOARD, limits=FlightLimits(setpoint_loss_action=number))) is expected


@pytest.mark.requirement("REQ-LINK-1")
@pytest.mark.parametrize(
    ("number", "expected"),
    [
        (0, Action.WARN),
        (1, Action.HOLD),
        (2, Action.RETURN),
        (3, Action.LAND),
        (5, Action.TERMINATE),
    ],
)
def test_a_lost_station_is_acted_on_as_the_parameter_says(number: int, expected: Action) -> None:
    lost = replace(FINE, gcs_silent_us=10_000_000, limits=FlightLimits(station_loss_action=number))
    for mode in (Mode.HOLD, Mode.MISSION, Mode.TRAJECTORY, Mode.OFFBOARD, Mode.ORBIT):
        assert action(replace(lost, mode=mode, setpoint_age_us=0)) is expected
    assert action(replace(lost, landed=True)) is Action.NONE


@pytest.mark.parametrize(
    ("bits", "excepted"),
    [
        (0, set()),
        (1, {Mode.MISSION}),
        (2, {Mode.HOLD, Mode.TAKEOFF}),
        (4, {Mode.OFFBOARD}),
        (7, {Mode.MISSION, Mode.HOLD, Mode.TAKEOFF, Mode.OFFBOARD}),
        (8, {Mode.TRAJECTORY}),
    ],
)
def test_a_lost_station_is_ignored_in_the_modes_of_the_parameter_alone(
    bits: int, excepted: set[Mode]
) -> None:
    limits = FlightLimits(station_loss_exceptions=bits)
    lost = replace(FINE, gcs_silent_us=10_000_000, limits=limits)
    flown = set(Mode) - {Mode.DISARMED, Mode.FAULT}
    ignored = {mode for mode in flown if action(replace(lost, mode=mode)) is Action.NONE}
    assert ignored == excepted
    held = replace(lost, mode=Mode.HOLD, failsafe_from=Mode.RETURN)
    assert action(held) is Action.RETURN, "the hold of a failsafe is none of the pilot's"


@pytest.mark.parametrize(
    ("number", "charge", "expected"),
    [
        (0, BatteryWarning.CRITICAL, Action.WARN),
        (0, BatteryWarning.EMERGENCY, Action.WARN),
        (2, BatteryWarning.LOW, Action.WARN),
        (2, BatteryWarning.CRITICAL, Action.LAND),
        (2, BatteryWarning.EMERGENCY, Action.LAND),
        (3, BatteryWarning.LOW, Action.WARN),
        (3, BatteryWarning.CRITICAL, Action.RETURN),
        (3, BatteryWarning.EMERGENCY, Action.LAND),
    ],
)
def test_a_low_battery_is_acted_on_as_the_parameter_says(
    number: int, charge: BatteryWarning, expected: Action
) -> None:
    context = replace(FINE, battery=charged(charge), limits=FlightLimits(low_battery_action=number))
    assert action(context) is expected


@pytest.mark.requirement("REQ-BAT-2", "REQ-BAT-3")
def test_a_battery_that_is_critical_returns_and_one_nearly_empty_lands_by_default() -> None:
    assert action(replace(FINE, battery=charged(BatteryWarning.LOW))) is Action.WARN
    assert action(replace(FINE, battery=charged(BatteryWarning.CRITICAL))) is Action.RETURN
    assert action(replace(FINE, battery=charged(BatteryWarning.EMERGENCY))) is Action.LAND


@pytest.mark.requirement("REQ-BAT-4")
@pytest.mark.parametrize(
    ("number", "expected"), [(0, Action.NONE), (1, Action.WARN), (3, Action.RETURN)]
)
def test_a_short_flight_time_is_acted_on_as_the_parameter_says(
    number: int, expected: Action
) -> None:
    short = replace(FINE, battery=BatteryState(time_left=20.0))
    assert action(replace(short, limits=FlightLimits(flight_time_action=number))) is expected
    (row,) = active(short.context())
    needed = way_home_s(short.context())
    text = report(row, short.context(), Action.RETURN)[1]
    assert f"20 s left, {needed:.0f} s needed for the way home" in text


@pytest.mark.requirement("REQ-BAT-4")
def test_the_way_home_is_across_up_and_down_with_a_factor_and_a_margin() -> None:
    limits = FlightLimits(return_time_factor=2.0, return_time_margin=7.0, return_wait=3.0)
    context = replace(FINE, limits=limits).context()
    there = context.estimate._replace(p_WB=(30.0, -40.0, -1.5))
    # 50 m across, 0.5 m up at 1 m/s; 3 s there; 2 m down at 0.25 m/s
    assert way_home_s(replace(context, estimate=there)) == pytest.approx(2.0 * 61.5 + 7.0)


@pytest.mark.requirement("REQ-SAFE-4")
@pytest.mark.parametrize(
    ("number", "expected"),
    [
        (0, Action.NONE),
        (1, Action.WARN),
        (2, Action.HOLD),
        (3, Action.RETURN),
        (4, Action.TERMINATE),
        (5, Action.LAND),
        (6, Action.RETREAT),
    ],
)
def test_a_fence_is_acted_on_as_the_parameter_says(number: int, expected: Action) -> None:
    outside = replace(FINE, safety=OVER_THE_FENCE, limits=FlightLimits(fence_action=number))
    assert action(outside) is expected
    inside = replace(FINE, safety=OUTSIDE, limits=FlightLimits(fence_action=number))
    assert action(inside) is Action.RETREAT, "what is announced has a parameter of its own"


@pytest.mark.requirement("REQ-ACT-5")
@pytest.mark.parametrize(
    ("number", "expected"),
    [
        (0, Action.WARN),
        (1, Action.HOLD),
        (2, Action.LAND),
        (3, Action.RETURN),
        (4, Action.TERMINATE),
    ],
)
def test_an_actuator_that_fails_is_acted_on_as_the_parameter_says(
    number: int, expected: Action
) -> None:
    limits = FlightLimits(actuator_failure_action=number)
    for damage in (Damage(rotor="rotor 1"), Damage(joint="joint 2")):
        assert action(replace(FINE, damage=damage, limits=limits)) is expected


LOST = Damage(rotor="rotor 1", report=ActuatorReport(rotor=1, lost=True))


def test_a_lost_rotor_terminates_and_with_the_circuit_breaker_the_vehicle_lands() -> None:
    assert conditions(replace(FINE, damage=LOST)) == (Condition.ROTOR_LOST, Condition.ROTOR_FAILED)
    assert conditions(replace(FINE, landed=True, damage=LOST)) == ()
    for breaker, expected in ((0, Action.TERMINATE), (121212, Action.LAND)):
        limits = FlightLimits(termination_breaker=breaker)
        context = replace(FINE, damage=LOST, limits=limits).context()
        assert ROWS[Condition.ROTOR_LOST].action(context) is expected


@pytest.mark.parametrize(
    ("number", "held", "bent"),
    [
        (0, Action.WARN, Action.WARN),
        (2, Action.LAND, Action.LAND),
        (3, Action.RETURN, Action.LAND),
        (4, Action.TERMINATE, Action.TERMINATE),
    ],
)
def test_a_lost_rotor_that_others_fly_without_is_one_that_failed(
    number: int, held: Action, bent: Action
) -> None:
    """Where they hold the heading in one posture alone, the vehicle lands at least."""
    limits = FlightLimits(actuator_failure_action=number)
    for balance, expected in ((None, held), ((0.5, 0.5), bent)):
        report = ActuatorReport(rotor=1, effect=0.0, lost=True)
        damage = Damage("rotor 1", report=report, spared=True, balance=balance)
        flown = replace(FINE, damage=damage, limits=limits)
        assert conditions(flown) == (Condition.ROTOR_LOST,), "which is told once"
        assert ROWS[Condition.ROTOR_LOST].action(flown.context()) is expected


@pytest.mark.parametrize("report", [ActuatorReport(1, 0.49), ActuatorReport(1, disobeys=True)])
@pytest.mark.parametrize(
    ("number", "expected"),
    [(0, Action.WARN), (1, Action.LAND), (3, Action.LAND), (4, Action.TERMINATE)],
)
def test_without_control_of_the_heading_the_vehicle_lands_at_least(
    report: ActuatorReport, number: int, expected: Action
) -> None:
    limits = FlightLimits(actuator_failure_action=number)
    assert action(replace(FINE, damage=Damage("rotor 1", report=report), limits=limits)) is expected


@pytest.mark.requirement("REQ-EST-9")
def test_the_circuit_breaker_makes_a_warning_of_an_attitude_failure() -> None:
    over = replace(FINE, safety=SafetyMemory(rolled_us=NOW_US - 500_000))
    assert action(over) is Action.TERMINATE
    assert action(replace(over, limits=FlightLimits(termination_breaker=121212))) is Action.WARN


@pytest.mark.requirement("REQ-SAFE-4")
@pytest.mark.parametrize(
    ("number", "expected"),
    [(1, Action.WARN), (2, Action.HOLD), (5, Action.LAND), (6, Action.RETREAT)],
)
def test_a_breach_is_acted_on_as_the_parameter_says(number: int, expected: Action) -> None:
    outside = replace(FINE, safety=OUTSIDE, limits=FlightLimits(breach_action=number))
    assert action(outside) is expected
    soft = replace(outside, config=replace(CONFIG, soft=True))
    assert action(soft) is Action.WARN, "it was to be flown all the same"
    naive = replace(outside, config=replace(CONFIG, controller="naive"))
    assert action(naive) is Action.WARN, "it has no barriers"
    retreat = action(replace(FINE, safety=OUTSIDE))
    assert (retreat, retreat.mode) == (Action.RETREAT, Mode.HOLD)


def test_a_breach_and_a_departure_are_critical_texts_with_a_length() -> None:
    for safety, words in (
        (OUTSIDE, "failsafe: outside the safe set by 12 mm, retreating"),
        (OFF_PLAN, "off the plan by 83 mm: replanning"),
    ):
        context = replace(FINE, safety=safety).context()
        (row,) = active(context)
        assert report(row, context, row.action(context)) == (Severity.CRITICAL, words)
    warned = replace(FINE, safety=OUTSIDE, limits=FlightLimits(breach_action=1)).context()
    (row,) = active(warned)
    severity, text = report(row, warned, Action.WARN)
    assert (severity, text) == (Severity.CRITICAL, "outside the safe set by 12 mm: warn")


def test_a_report_names_the_condition_its_number_and_what_is_done() -> None:
    lost = replace(FINE, gcs_silent_us=12_000_000).context()
    (row,) = active(lost)
    assert report(row, lost, Action.RETURN) == (
        Severity.CRITICAL,
        "failsafe: no ground station for 12 s, returning",
    )
    assert report(row, lost, Action.RETURN, 5_000_000)[1].endswith("12 s, returning in 5 s")
    low = replace(FINE, battery=charged(BatteryWarning.CRITICAL)).context()
    (row,) = active(low)
    assert report(row, low, Action.WARN) == (Severity.CRITICAL, "battery critical: 7 % left")
    over = replace(FINE, safety=SafetyMemory(pitched_us=NOW_US - 310_000)).context()
    (row,) = active(over)
    assert report(row, over, Action.TERMINATE) == (
        Severity.EMERGENCY,
        "tilt beyond recovery: pitch above 60 deg for 0.31 s: terminate",
    )


@pytest.mark.requirement("REQ-PLAN-2")
@pytest.mark.parametrize(
    ("plan", "words"),
    [
        (PlanMemory(awaited_missed=True), "planner silent, last plan 0.40 s ago"),
        (PlanMemory(status=SolverStatus.INFEASIBLE), "planner infeasible, last plan 0.40 s ago"),
        (PlanMemory(status=SolverStatus.TIME_LIMIT), "planner out of time, last plan 0.40 s ago"),
        (
            PlanMemory(status=SolverStatus.INPUT_REFUSED, reason="a target is not finite"),
            "planner input refused, a target is not finite, last plan 0.40 s ago",
        ),
    ],
)
def test_a_planner_that_does_not_plan_is_told_with_why_and_since_when(
    plan: PlanMemory, words: str
) -> None:
    refused = not plan.awaited_missed
    stale = replace(FINE, plan=plan, plan_refused=refused, plan_age_us=400_000).context()
    row = ROWS[Condition.PLAN_STALE]
    assert row in active(stale)
    assert report(row, stale, Action.BRAKE)[1] == f"no plan for three periods: {words}: brake"


@pytest.mark.requirement("REQ-PLAN-3")
def test_a_planner_that_is_lost_for_long_lets_the_vehicle_descend() -> None:
    lost = replace(FINE, plan_age_us=5_000_001)
    assert conditions(lost) == (Condition.PLANNER_LOST, Condition.PLAN_STALE)
    assert ROWS[Condition.PLANNER_LOST].action(lost.context()) is Action.DESCEND
    descending = replace(lost, mode=Mode.DESCEND)
    assert conditions(descending) == (Condition.PLANNER_LOST,), "nothing brakes"
    assert conditions(replace(lost, landed=True)) == ()


def test_setpoints_stay_lost_until_they_come_again_or_the_pilot_takes_over() -> None:
    held = replace(OFFBOARD, mode=Mode.HOLD, failsafe_from=Mode.OFFBOARD)
    lost = replace(held, known=(Condition.SETPOINTS_LOST,))
    assert conditions(lost) == (Condition.SETPOINTS_LOST,)
    for over in (replace(lost, setpoint_age_us=0), replace(lost, failsafe_from=None), held):
        assert conditions(over) == ()


def test_between_two_planning_periods_slow_rows_are_as_they_were_found_last() -> None:
    evidence = replace(
        FINE,
        output_replaced=True,
        battery=charged(BatteryWarning.LOW),
        known=(Condition.ZONES_SILENT, Condition.TUBE_LEFT),
    )
    found = [row.condition for row in active_between(evidence.context())]
    assert found == [Condition.OUTPUT_NOT_FINITE, Condition.ZONES_SILENT]
    assert active_between(FINE.context()) == ()


QUICK = {row.condition for row in FAILSAFES if not row.slow}
ALARMING = (
    replace(FINE, invalid_ticks=5, output_replaced=True),
    replace(FINE, mode=Mode.DISARMED, invalid_ticks=5),
    replace(FINE, output_replaced=True),
    replace(FINE, aiding=Aiding(attitude_sigma=math.nan)),
    replace(FINE, aiding=Aiding(250_000, position_sigma=math.nan)),
    replace(FINE, aiding=replaced_sensor(50_000)),
    replace(FINE, safety=SafetyMemory(rolled_us=NOW_US - 300_000)),
    replace(FINE, safety=SafetyMemory(pitched_us=NOW_US - 300_000)),
    replace(FINE, safety=OUTSIDE),
    replace(FINE, safety=OVER_THE_FENCE),
    replace(FINE, safety=OFF_PLAN),
    replace(FINE, safety=SafetyMemory(filter_us=0)),
    replace(FINE, pressing={"near": 1, "pressed": 4.8, "unsure": 0.3, "most": 5.0}),
    replace(FINE, damage=Damage("rotor 1", report=ActuatorReport(1, lost=True))),
    replace(FINE, plan_age_us=3 * PERIOD_US + 1),
    replace(FINE, plan_refused=True),
    replace(FINE, plan=PlanMemory(awaited_missed=True)),
    OFFBOARD,
    replace(OFFBOARD, mode=Mode.HOLD, failsafe_from=Mode.OFFBOARD, known=(*QUICK,)),
)


def test_every_quick_row_is_asked_between_two_planning_periods() -> None:
    found: set[Condition] = set()
    for evidence in ALARMING:
        rows = active_between(replace(evidence, known=()).context())
        found |= {row.condition for row in rows}
    assert found >= QUICK - {Condition.SETPOINTS_LOST}


def test_the_rows_name_parameters_that_exist_and_times_that_can_be_kept() -> None:
    for row in FAILSAFES:
        assert set(row.parameters) <= set(BY_NAME), row.condition
        assert row.within_us <= 1_100_000
        assert (row.within_us >= 100_000) if row.slow else True


def lost_rows(evidence: Evidence) -> dict[Condition, Action]:
    context = evidence.context()
    return {row.condition: row.action(context) for row in active(context)}


@pytest.mark.requirement("REQ-EST-4", "REQ-EST-5")
@pytest.mark.parametrize(
    ("sigma", "expected"),
    [
        (0.1, {}),
        (0.11, {Condition.POSITION_LOW: Action.HOLD}),
        (0.51, {Condition.POSITION_LOST: Action.DESCEND, Condition.POSITION_LOW: Action.HOLD}),
        (math.nan, {Condition.POSITION_LOST: Action.DESCEND, Condition.POSITION_LOW: Action.HOLD}),
    ],
)
def test_in_dead_reckoning_it_holds_and_then_descends(
    sigma: float, expected: dict[Condition, Action]
) -> None:
    trajectory = replace(FINE, mode=Mode.TRAJECTORY)
    adrift = replace(trajectory, aiding=UNAIDED._replace(position_sigma=sigma))
    assert lost_rows(adrift) == {**expected, Condition.AIDING_LOST: Action.DEAD_RECKON}


@pytest.mark.requirement("REQ-EST-4")
@pytest.mark.parametrize(("elsewhere", "holds"), [(0.1, False), (0.11, True), (5.0, True)])
def test_it_holds_where_refused_positions_say_that_it_is_elsewhere(
    elsewhere: float, holds: bool
) -> None:
    """It had flown on by a jump that was believed a second later, and by then it was fast."""
    trajectory = replace(FINE, mode=Mode.TRAJECTORY)
    disputed = replace(trajectory, aiding=UNAIDED._replace(elsewhere=elsewhere))
    hold = {Condition.POSITION_LOW: Action.HOLD} if holds else {}
    assert lost_rows(disputed) == {**hold, Condition.AIDING_LOST: Action.DEAD_RECKON}
    aided = replace(trajectory, aiding=Aiding(elsewhere=elsewhere))
    assert lost_rows(aided) == {}


@pytest.mark.requirement("REQ-EST-4", "REQ-EST-10")
@pytest.mark.parametrize(("unproven", "holds"), [(0.1, False), (0.11, True), (5.0, True)])
def test_it_holds_where_jumps_have_added_up(unproven: float, holds: bool) -> None:
    trajectory = replace(FINE, mode=Mode.TRAJECTORY, aiding=Aiding(unproven=(0.0, -unproven, 0.0)))
    assert lost_rows(trajectory) == ({Condition.POSITION_LOW: Action.HOLD} if holds else {})


@pytest.mark.requirement("REQ-EST-4", "REQ-EST-6")
@pytest.mark.parametrize(
    ("number", "expected"), [(1, Action.WARN), (2, Action.HOLD), (5, Action.LAND)]
)
def test_lost_sensors_are_acted_on_as_the_parameters_say(number: int, expected: Action) -> None:
    limits = FlightLimits(position_low_action=number, sensor_loss_action=number)
    fine = replace(FINE, mode=Mode.TRAJECTORY, limits=limits)
    adrift = lost_rows(replace(fine, aiding=UNAIDED._replace(position_sigma=0.2)))
    assert adrift[Condition.POSITION_LOW] is expected
    assert action(replace(fine, aiding=replaced_sensor(60_000))) is expected


@pytest.mark.requirement("REQ-EST-3", "REQ-EST-6")
def test_a_text_names_the_sensor_and_since_when() -> None:
    for aiding, words in (
        (
            UNAIDED,
            "no position measurement: pose stuck, for 1.50 s: dead reckoning",
        ),
        (
            replaced_sensor(60_000),
            "failsafe: sensor lost: IMU stuck, for 0.06 s, holding",
        ),
        (
            Aiding(400_000, Sensor.POSE, SensorFault.JUMP, elsewhere=1.05),
            "failsafe: position uncertain by 1050 mm: pose jump rejected, for 0.40 s, holding",
        ),
        (
            Aiding(unproven=(0.0, 0.36, -0.27)),
            "failsafe: position uncertain by 450 mm: it has jumped, holding",
        ),
        (
            Aiding(400_000, Sensor.POSE, SensorFault.NOT_FINITE, attitude_sigma=0.8),
            "attitude unknown: pose not finite, for 0.40 s: terminate",
        ),
    ):
        context = replace(FINE, mode=Mode.TRAJECTORY, aiding=aiding).context()
        row = active(context)[0]
        assert report(row, context, row.action(context))[1] == words


def test_a_fault_is_the_vehicles_own() -> None:
    others = {Condition.SETPOINTS_LOST, Condition.DATALINK_LOST, Condition.BATTERY_LOW}
    others |= {Condition.ZONES_SILENT, Condition.FLIGHT_TIME_LOW, Condition.PLAN_LATE}
    others |= {Condition.TIME_JUMPED, Condition.LOOP_OVERRUN, Condition.CLOCK_JUMPED}
    others |= {Condition.LINK_FLOODED, Condition.LOG_STOPPED, Condition.DISK_FULL}
    others |= {Condition.ROOM_LACKING, Condition.PARAMETERS_CONTRADICT}
    others |= {Condition.CONTACT_LOST, Condition.SURFACE_MOVED, Condition.TOOL_SLIPS}
    others |= {Condition.PAYLOAD_HEAVY}
    others |= {Condition.BATTERY_CRITICAL, Condition.BATTERY_EMERGENCY}
    assert set(Condition) - others == FAULTS


@pytest.mark.parametrize("share", [0.0, 0.5, 0.994, 1.0])
def test_what_is_left_of_the_battery_is_told_in_percent(share: float) -> None:
    battery = BatteryState(remaining=share, charge=BatteryWarning.LOW)
    context = replace(FINE, battery=battery).context()
    (row,) = active(context)
    assert report(row, context, Action.WARN)[1] == f"battery low: {round(100 * share)} % left"


@pytest.mark.requirement("REQ-SAFE-11")
def test_room_is_lacking_in_flight_only_for_a_while_and_by_more_than_a_workspace_does() -> None:
    for evidence in (
        replace(FINE, kept=CRAMPED, landed=True),
        replace(FINE, kept=CRAMPED._replace(sufficient_us=NOW_US - 499_999)),
        replace(FINE, kept=CRAMPED._replace(shortfall=0.01)),
    ):
        assert conditions(evidence) == ()
    cramped = replace(FINE, kept=CRAMPED)
    assert action(cramped) is Action.WARN
    (row,) = active(cramped.context())
    severity, text = report(row, cramped.context(), Action.WARN)
    assert severity is Severity.CRITICAL
    assert text.endswith("23 mm less than SAFE_SIGMAS asks for")


@pytest.mark.requirement("REQ-EST-5")
def test_without_a_position_it_descends_where_clearances_lack_room() -> None:
    for unaided_us, sigma, expected in (
        (1_500_000, 0.11, Action.DESCEND),
        (1_500_000, 0.09, Action.WARN),
        (0, 0.11, Action.WARN),
    ):
        aiding = Aiding(unaided_us, Sensor.POSE, position_sigma=sigma)
        context = replace(FINE, kept=CRAMPED, aiding=aiding).context()
        (row,) = [one for one in active(context) if one.condition is Condition.ROOM_LACKING]
        assert row.action(context) is expected


@pytest.mark.requirement("REQ-SAFE-14")
@pytest.mark.parametrize(
    "pressing",
    [
        {"near": 1, "pressed": 4.9, "most": 5.0},
        {"near": 0, "pressed": 5.1, "most": 5.0},
        {"near": 1, "lost_for": 0.9},
        {"contact": 1, "distance": 0.05, "slip": (0.1, 0.1, 0.0)},
        {"contact": 0, "distance": -0.07, "slip": (0.3, 0.0, 0.0)},
    ],
)
def test_a_contact_as_it_should_be_is_no_condition(pressing: dict[str, Any]) -> None:
    assert conditions(replace(FINE, pressing=pressing)) == ()


@pytest.mark.requirement("REQ-SAFE-14")
def test_what_is_wrong_with_a_contact_leads_off_the_surface() -> None:
    too_hard = replace(FINE, pressing={"near": 1, "pressed": 5.06, "most": 5.0})
    assert action(too_hard) is Action.RETREAT
    (row,) = active(too_hard.context())
    assert row.detail(too_hard.context()) == ": 5.1 N, or 0.0 N more, of 5.0 N"
    on_the_ground = replace(too_hard, mode=Mode.DISARMED)
    assert conditions(on_the_ground) == ()
