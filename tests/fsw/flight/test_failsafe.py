"""Which condition is active when, and what is done about it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.estimation.sensor_fault import Sensor, SensorFault
from fsw.flight.failsafe import (
    FAILSAFES,
    FAULTS,
    MIN_UP,
    Action,
    Condition,
    FailsafeContext,
    active,
    report,
)
from fsw.flight.state import (
    AIDED,
    Aiding,
    FlightState,
    MissionMemory,
    OffboardMemory,
    PlanMemory,
    SafetyMemory,
    VehicleMemory,
)
from fsw.flight.uncertain_clearance import KeptSet
from fsw.parameters.flight_config import FlightConfig, FlightLimits, flight_config
from fsw.signals import BatteryState, Charge, Mode, Severity
from tests.fsw.random_states import random_estimate

PERIOD_US = 100_000
NOW_US = 10**9
CONFIG = flight_config(body="points")
AMPLE = KeptSet(ample_us=NOW_US)
MANUAL = frozenset({Mode.HOLD, Mode.OFFBOARD})


@dataclass(frozen=True)
class Evidence:
    """What a condition may depend on, in the words of the tests."""

    limits: FlightLimits = field(default_factory=FlightLimits)
    mode: Mode = Mode.HOLD
    landed: bool = False
    invalid_ticks: int = 0
    up: float = 1.0
    plan_age_us: int = PERIOD_US
    plan_refused: bool = False
    output_replaced: bool = False
    setpoint_age_us: int = 0
    gcs_silent_us: int = 0
    battery: BatteryState = field(default_factory=BatteryState)
    silent_zones: int = 0
    safety: SafetyMemory = field(default_factory=SafetyMemory)
    aiding: Aiding = AIDED
    kept: KeptSet = AMPLE
    config: FlightConfig = CONFIG

    def context(self) -> FailsafeContext:
        heard_us = NOW_US - self.gcs_silent_us if self.gcs_silent_us >= 0 else -1
        state = FlightState(
            invalid_ticks=self.invalid_ticks,
            output_replaced=self.output_replaced,
            vehicle=VehicleMemory(mode=self.mode, landed=self.landed, gcs_heard_us=heard_us),
            plan=PlanMemory(since_us=NOW_US - self.plan_age_us, refused=self.plan_refused),
            offboard=OffboardMemory(motion_us=NOW_US - self.setpoint_age_us),
            battery=self.battery,
            mission=MissionMemory(silent_zones=self.silent_zones),
            safety=self.safety,
            aiding=self.aiding,
            kept=self.kept,
        )
        level = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, self.up)
        estimate = random_estimate(np.random.default_rng(1))._replace(t_us=NOW_US, R_WB=level)
        return FailsafeContext(state, estimate, replace(self.config, limits=self.limits), MANUAL)


FINE = Evidence()
OUTSIDE = SafetyMemory(breach_us=NOW_US, breach_by=0.0123)
CRAMPED = KeptSet(lacking=0.0234, ample_us=NOW_US - 500_000)
OFF_PLAN = SafetyMemory(off_plan_us=NOW_US, off_plan_by=0.0834)
UNAIDED = Aiding(1_500_000, Sensor.POSE, SensorFault.STUCK)


def replaced_sensor(for_us: int) -> Aiding:
    """Something stands in for the IMU."""
    return Aiding(sensor=Sensor.IMU, fault=SensorFault.STUCK, since_us=NOW_US - for_us)


OFFBOARD = replace(FINE, mode=Mode.OFFBOARD, setpoint_age_us=500_000)


def charged(charge: Charge) -> BatteryState:
    return BatteryState(remaining=0.07, charge=charge)


def conditions(evidence: Evidence) -> tuple[Condition, ...]:
    return tuple(row.condition for row in active(evidence.context()))


def action(evidence: Evidence) -> Action:
    (row,) = active(evidence.context())
    return row.action(evidence.context())


def test_every_condition_has_one_row() -> None:
    assert [row.condition for row in FAILSAFES] == list(Condition)


def test_without_attitude_the_flight_is_ended_and_only_then() -> None:
    ending = {row.condition for row in FAILSAFES if row.action(FINE.context()) is Action.TERMINATE}
    assert ending == {Condition.ATTITUDE_LOST, Condition.TILT_LOST}


def test_nothing_wrong_is_no_condition() -> None:
    assert active(FINE.context()) == ()


@pytest.mark.parametrize(
    ("evidence", "condition"),
    [
        (replace(FINE, invalid_ticks=5), Condition.ESTIMATE_INVALID),
        (replace(FINE, mode=Mode.DISARMED, invalid_ticks=5), Condition.ESTIMATE_INVALID),
        (replace(FINE, aiding=Aiding(attitude_sigma=0.71)), Condition.ATTITUDE_LOST),
        (replace(FINE, aiding=Aiding(attitude_sigma=math.nan)), Condition.ATTITUDE_LOST),
        (replace(FINE, aiding=Aiding(250_000)), Condition.AIDING_LOST),
        (replace(FINE, aiding=replaced_sensor(50_000)), Condition.SENSOR_LOST),
        (replace(FINE, up=MIN_UP), Condition.TILT_LOST),
        (replace(FINE, up=0.339), Condition.TILT_LOST),
        (replace(FINE, up=-1.0), Condition.TILT_LOST),
        (replace(FINE, up=math.nan), Condition.TILT_LOST),
        (replace(FINE, plan_age_us=3 * PERIOD_US + 1), Condition.PLAN_STALE),
        (replace(FINE, plan_refused=True), Condition.PLAN_REFUSED),
        (replace(FINE, output_replaced=True), Condition.OUTPUT_NOT_FINITE),
        (replace(FINE, safety=OUTSIDE), Condition.BREACH),
        (replace(FINE, safety=OFF_PLAN), Condition.TUBE_LEFT),
        (replace(FINE, kept=CRAMPED), Condition.ROOM_LACKING),
        (OFFBOARD, Condition.SETPOINTS_LOST),
        (replace(FINE, silent_zones=1), Condition.ZONES_SILENT),
        (replace(FINE, gcs_silent_us=10_000_000), Condition.DATALINK_LOST),
        (replace(FINE, battery=charged(Charge.LOW)), Condition.BATTERY_LOW),
        (replace(FINE, battery=charged(Charge.CRITICAL)), Condition.BATTERY_CRITICAL),
        (replace(FINE, battery=charged(Charge.EMERGENCY)), Condition.BATTERY_EMERGENCY),
    ],
)
def test_each_evidence_is_its_condition(evidence: Evidence, condition: Condition) -> None:
    assert conditions(evidence) == (condition,)


@pytest.mark.parametrize(
    "evidence",
    [
        replace(FINE, invalid_ticks=4),  # a lost frame or two are flown through
        replace(FINE, up=0.341),  # just short of 70 degrees
        replace(FINE, plan_age_us=3 * PERIOD_US),
        replace(FINE, landed=True, up=-1.0),  # carried about upside down
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


@given(st.integers(0, 5), st.floats(allow_nan=True), st.integers(0, 10**6), st.booleans())
def test_the_strongest_action_comes_first(
    invalid: int, up: float, age_us: int, refused: bool
) -> None:
    evidence = replace(FINE, invalid_ticks=invalid, up=up, plan_age_us=age_us, plan_refused=refused)
    context = evidence.context()
    order = list(Action)
    strengths = [order.index(row.action(context)) for row in active(context)]
    assert strengths == sorted(strengths, reverse=True)


@pytest.mark.parametrize(
    ("number", "expected"),
    [(0, Action.HOLD), (3, Action.RETURN), (4, Action.LAND), (5, Action.HOLD)],
)
def test_lost_setpoints_are_acted_on_as_the_parameter_says(number: int, expected: Action) -> None:
    assert action(replace(OFFBOARD, limits=FlightLimits(setpoint_loss_action=number))) is expected


@pytest.mark.parametrize(
    ("number", "expected"),
    [(0, Action.NONE), (1, Action.HOLD), (2, Action.RETURN), (3, Action.LAND)],
)
def test_a_lost_station_is_acted_on_as_the_parameter_says(number: int, expected: Action) -> None:
    lost = replace(FINE, gcs_silent_us=10_000_000, limits=FlightLimits(station_loss_action=number))
    assert action(lost) is expected
    assert action(replace(lost, mode=Mode.MISSION)) is Action.NONE, (
        "it flies by itself, and goes on"
    )
    assert action(replace(lost, landed=True)) is Action.NONE


@pytest.mark.parametrize(
    ("number", "charge", "expected"),
    [
        (0, Charge.CRITICAL, Action.WARN),
        (0, Charge.EMERGENCY, Action.WARN),
        (2, Charge.LOW, Action.WARN),
        (2, Charge.CRITICAL, Action.LAND),
        (2, Charge.EMERGENCY, Action.LAND),
        (3, Charge.LOW, Action.WARN),
        (3, Charge.CRITICAL, Action.RETURN),
        (3, Charge.EMERGENCY, Action.LAND),
    ],
)
def test_a_low_battery_is_acted_on_as_the_parameter_says(
    number: int, charge: Charge, expected: Action
) -> None:
    context = replace(FINE, battery=charged(charge), limits=FlightLimits(low_battery_action=number))
    assert action(context) is expected
    assert action(replace(context, landed=True)) is Action.WARN
    assert action(replace(context, mode=Mode.LAND)) is Action.WARN, "it lands already"
    returning = action(replace(context, mode=Mode.RETURN))
    assert returning is (Action.WARN if expected is Action.RETURN else expected)


@pytest.mark.parametrize(
    ("number", "expected"),
    [(1, Action.WARN), (2, Action.HOLD), (5, Action.LAND), (6, Action.RETREAT)],
)
def test_a_breach_is_acted_on_as_the_parameter_says(number: int, expected: Action) -> None:
    outside = replace(FINE, safety=OUTSIDE, limits=FlightLimits(breach_action=number))
    assert action(outside) is expected
    assert action(replace(outside, mode=Mode.LAND)) is Action.WARN, "it lands already"
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
    low = replace(FINE, battery=charged(Charge.CRITICAL)).context()
    (row,) = active(low)
    assert report(row, low, Action.WARN) == (Severity.CRITICAL, "battery critical: 7 % left")
    over = replace(FINE, up=0.0).context()
    (row,) = active(over)
    severity, text = report(row, over, Action.TERMINATE)
    assert (severity, text) == (Severity.EMERGENCY, "tilt beyond recovery: terminate")


def lost_rows(evidence: Evidence) -> dict[Condition, Action]:
    context = evidence.context()
    return {row.condition: row.action(context) for row in active(context)}


@pytest.mark.parametrize(
    ("sigma", "expected"),
    [
        (0.1, {}),
        (0.11, {Condition.POSITION_LOW: Action.HOLD}),
        (0.51, {Condition.POSITION_LOST: Action.LAND, Condition.POSITION_LOW: Action.HOLD}),
        (math.nan, {Condition.POSITION_LOST: Action.LAND, Condition.POSITION_LOW: Action.HOLD}),
    ],
)
def test_in_dead_reckoning_it_holds_and_then_lands(
    sigma: float, expected: dict[Condition, Action]
) -> None:
    trajectory = replace(FINE, mode=Mode.TRAJECTORY)
    adrift = replace(trajectory, aiding=UNAIDED._replace(position_sigma=sigma))
    assert lost_rows(adrift) == {**expected, Condition.AIDING_LOST: Action.DEAD_RECKON}
    landing = lost_rows(replace(adrift, mode=Mode.LAND))
    assert set(landing.values()) <= {Action.WARN, Action.DEAD_RECKON}, "it lands already"


@pytest.mark.parametrize(
    ("number", "expected"), [(1, Action.WARN), (2, Action.HOLD), (5, Action.LAND)]
)
def test_lost_sensors_are_acted_on_as_the_parameters_say(number: int, expected: Action) -> None:
    limits = FlightLimits(position_low_action=number, sensor_loss_action=number)
    fine = replace(FINE, mode=Mode.TRAJECTORY, limits=limits)
    adrift = lost_rows(replace(fine, aiding=UNAIDED._replace(position_sigma=0.2)))
    assert adrift[Condition.POSITION_LOW] is expected
    assert action(replace(fine, aiding=replaced_sensor(60_000))) is expected


def test_a_text_names_the_sensor_and_since_when() -> None:
    for aiding, words in (
        (
            UNAIDED,
            "no position is measured: pose is stuck at one reading, for 1.50 s: dead reckoning",
        ),
        (
            replaced_sensor(60_000),
            "failsafe: sensor lost: IMU is stuck at one reading, for 0.06 s, holding",
        ),
        (
            Aiding(400_000, Sensor.POSE, SensorFault.NOT_FINITE, attitude_sigma=0.8),
            "attitude unknown: pose says what is not a number, for 0.40 s: terminate",
        ),
    ):
        context = replace(FINE, mode=Mode.TRAJECTORY, aiding=aiding).context()
        row = active(context)[0]
        assert report(row, context, row.action(context))[1] == words


def test_a_fault_is_the_vehicles_own() -> None:
    others = {Condition.SETPOINTS_LOST, Condition.DATALINK_LOST, Condition.BATTERY_LOW}
    others |= {Condition.ZONES_SILENT, Condition.ROOM_LACKING}
    others |= {Condition.BATTERY_CRITICAL, Condition.BATTERY_EMERGENCY}
    assert set(Condition) - others == FAULTS


@pytest.mark.parametrize("share", [0.0, 0.5, 0.994, 1.0])
def test_what_is_left_of_the_battery_is_told_in_percent(share: float) -> None:
    battery = BatteryState(remaining=share, charge=Charge.LOW)
    context = replace(FINE, battery=battery).context()
    (row,) = active(context)
    assert report(row, context, Action.WARN)[1] == f"battery low: {round(100 * share)} % left"


def test_room_is_lacking_in_flight_only_for_a_while_and_by_more_than_a_workspace_does() -> None:
    for evidence in (
        replace(FINE, kept=CRAMPED, landed=True),
        replace(FINE, kept=CRAMPED._replace(ample_us=NOW_US - 499_999)),
        replace(FINE, kept=CRAMPED._replace(lacking=0.01)),
    ):
        assert conditions(evidence) == ()
    cramped = replace(FINE, kept=CRAMPED)
    assert action(cramped) is Action.WARN
    (row,) = active(cramped.context())
    severity, text = report(row, cramped.context(), Action.WARN)
    assert severity is Severity.CRITICAL
    assert text.endswith("23 mm less than SAFE_SIGMAS asks for")
