"""Why arming is refused, what force overrides, and what waiting does not change."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.flight.commands import arming
from fsw.autopilot.flight.commands.arming import Subject
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import Aiding, Damage, LostSensor
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.signals import BatteryState, ConstraintReport, HostHealth, Mode, SensorReport
from tests.fsw.autopilot.flight.contexts import LOW, STANDING, having
from tests.fsw.autopilot.flight.in_flight import limits
from tests.fsw.link.snapshots import REPORT
from tests.fsw.random_states import estimate_of

BLIND = having(STANDING, invalid_ticks=1)
UNCLEAR = having(STANDING, p_WB=LOW)
TERMINATED = having(STANDING, mode=Mode.FAULT)
INCONSISTENT = having(STANDING, refusals=("the sphere is too small",))
OUTSIDE = ConstraintReport(margins=(-0.02,))
FULL = HostHealth(log_failure="flight.ulg ends early")
EMPTY = BatteryState(remaining=0.0)
NOW_US = 7_000_000
LATER = having(STANDING, t_us=NOW_US)
SILENT = LostSensor(Sensor.IMU, SensorFault.STALE, -50_000)


def unwell(**changes: Any) -> Situation:
    return having(STANDING, **changes)


def tilted_by(degrees: float) -> Situation:
    return unwell(R_WB=estimate_of(Rotation.from_euler("y", degrees, degrees=True)).R_WB)


def failed(situation: Situation) -> str:
    """What is said where one check fails; empty where none does."""
    return "".join(sentence for _, sentence in arming.failed(situation))


@pytest.mark.requirement(
    "REQ-SAFE-8",
    "REQ-ARM-1",
    "REQ-ARM-2",
    "REQ-ARM-6",
    "REQ-ARM-7",
    "REQ-ARM-10",
    "REQ-ACT-6",
    "REQ-BAT-5",
)
@pytest.mark.parametrize(
    ("context", "subject", "words"),
    [
        (BLIND, Subject.ESTIMATOR, "estimate is invalid"),
        (TERMINATED, Subject.TERMINATION, "terminated; restart the flight software"),
        (unwell(aiding=Aiding(unaided_us=250_000)), Subject.ESTIMATOR, "no position"),
        (tilted_by(16.0), Subject.ATTITUDE, "tilted by 16 deg; 15 deg"),
        (tilted_by(180.0), Subject.ATTITUDE, "tilted by 180 deg"),
        (unwell(R_WB=(math.nan,) * 9), Subject.ATTITUDE, "tilted"),
        (unwell(aiding=Aiding(lost=(SILENT,))), Subject.SENSORS, "IMU silent"),
        (UNCLEAR, Subject.STANDING, "neither at rest on the ground nor clearly in the air"),
        (unwell(battery=BatteryState(remaining=0.0)), Subject.BATTERY, "0 % left, 10 % needed"),
        (unwell(battery=BatteryState(remaining=math.nan)), Subject.BATTERY, "battery"),
        (unwell(against="A is below B"), Subject.PARAMETERS, "A is below B"),
        (INCONSISTENT, Subject.SAFE_SET, "the sphere is too small"),
        (
            unwell(constraints=OUTSIDE),
            Subject.SAFE_SET,
            "outside its safe set by 20 mm",
        ),
        (unwell(qd_arm=(0.0, -2.1)), Subject.JOINTS, "swings"),
        (unwell(q_arm=(3.0, 0.0)), Subject.JOINTS, "joint 1 at 172 deg is beyond its limit"),
        (unwell(damage=Damage("rotor 2 gives nothing")), Subject.ACTUATORS, "rotor 2"),
        (
            unwell(host=FULL),
            Subject.STORAGE,
            "flight.ulg ends early",
        ),
    ],
)
def test_each_reason_is_a_sentence_and_force_overrides_all_but_a_missing_estimate(
    context: Situation, subject: Subject, words: str
) -> None:
    ((number, sentence),) = arming.failed(context)
    assert arming.CHECKS[number].subject is subject
    assert words in sentence
    assert arming.refusal(context) == f"not armed: {sentence}"
    forced = arming.refusal(context, force=True)
    assert (forced is None) is (context not in (BLIND, TERMINATED))


def test_behind_a_termination_or_a_missing_estimate_nothing_else_is_told() -> None:
    worse = having(TERMINATED, invalid_ticks=1, refusals=("the sphere is too small",))
    for context, told in ((worse, "the flight was terminated"), (BLIND, "the state estimate")):
        refusal = arming.refusal(context) or ""
        assert refusal.startswith(f"not armed: {told}")
        assert arming.refusal(context, force=True) == refusal


def test_every_subject_has_a_check() -> None:
    assert {check.subject for check in arming.CHECKS} == set(Subject)


@pytest.mark.requirement("REQ-ARM-2")
def test_a_vehicle_that_stands_and_is_well_arms_and_all_that_is_not_well_is_said() -> None:
    assert arming.refusal(STANDING) is None
    several = having(INCONSISTENT, battery=EMPTY, R_WB=tilted_by(57.0).estimate.R_WB)
    assert (arming.refusal(several) or "").count(";") == 3


def test_only_a_configuration_is_a_reason_that_waiting_does_not_change() -> None:
    assert arming.is_permanent(INCONSISTENT)
    for passing in (
        STANDING,
        having(INCONSISTENT, invalid_ticks=1),
        having(INCONSISTENT, p_WB=LOW),
        having(INCONSISTENT, battery=EMPTY),
    ):
        assert not arming.is_permanent(passing)


# ---------------------------------------------------------------- from the state of the vehicle


@pytest.mark.requirement("REQ-ARM-3")
@pytest.mark.parametrize("degrees", [0.0, 14.0, 30.0, 89.0, 180.0])
def test_the_tilt_is_that_of_the_estimate(degrees: float) -> None:
    allowed = degrees < 15.0
    words = "" if allowed else f"the vehicle is tilted by {degrees:.0f} deg; 15 deg are allowed"
    assert failed(tilted_by(degrees)) == words


@pytest.mark.requirement("REQ-ARM-3")
def test_an_attitude_that_is_no_number_is_upside_down() -> None:
    assert "tilted by 180 deg" in failed(unwell(R_WB=(math.nan,) * 9))


@pytest.mark.requirement("REQ-ARM-4")
@pytest.mark.parametrize(
    ("aiding", "words"),
    [
        (Aiding(unaided_us=250_000), "no position measurement: pose silent"),
        (Aiding(attitude_sigma=0.3), "roll and pitch are known to 17 deg only"),
        (Aiding(attitude_sigma=math.nan), "roll and pitch"),
        (Aiding(unaided_us=249_999, attitude_sigma=0.2), ""),
    ],
)
def test_an_estimate_that_is_not_aided_or_not_known_is_no_estimate(
    aiding: Aiding, words: str
) -> None:
    found = failed(unwell(aiding=aiding))
    assert found.startswith(words)
    assert bool(found) is bool(words)


@pytest.mark.requirement("REQ-SAFE-8", "REQ-ARM-4", "REQ-ACT-6")
def test_sensors_margins_damage_and_the_log_are_looked_at() -> None:
    lost = LostSensor(Sensor.ENCODERS, SensorFault.STUCK, NOW_US - 50_000)
    soon = lost._replace(since_us=NOW_US - 49_999)
    for found in ((lost,), (soon._replace(sensor=Sensor.IMU), lost)):
        assert "encoders stuck" in failed(having(LATER, aiding=Aiding(lost=found)))
    assert failed(having(LATER, aiding=Aiding(lost=(soon,)))) == "", "for a moment"
    for silent_us, words in ((2_400_000, "barometer has been silent for 2 s"), (10**6, "")):
        report = replace(REPORT, sensors=(SensorReport("barometer", silent_us),))
        assert failed(having(LATER, estimator=report)) == words
    outside = failed(unwell(constraints=ConstraintReport(margins=(0.2, -0.1))))
    assert outside == "the vehicle is outside its safe set by 100 mm"
    assert failed(unwell(damage=Damage(joint="joint 1 is stuck"))) == "joint 1 is stuck"
    full = HostHealth(log_failure="flight.ulg ends early: No space left on device")
    assert "No space left" in failed(unwell(host=full))
    assert failed(unwell(config=limits(arm_without_log=1), host=full)) == ""


@pytest.mark.requirement("REQ-BAT-5")
@pytest.mark.parametrize(("least", "needed"), [(-1.0, 0.1), (0.0, 0.0), (0.4, 0.4)])
def test_the_least_charge_is_a_parameter_and_by_default_the_critical_one(
    least: float, needed: float
) -> None:
    config, left = limits(arm_battery=least), BatteryState(remaining=0.07)
    words = failed(unwell(config=config, battery=left))
    assert bool(words) is (needed > 0.07)
    assert not words or f"7 % left, {100.0 * needed:.0f} % needed" in words
