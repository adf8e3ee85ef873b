"""Why arming is refused, what force overrides, and what waiting does not change."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.flight.commands import arming
from fsw.autopilot.flight.commands.arming import Subject
from fsw.autopilot.flight.commands.arming_health import ArmingHealth, arming_health
from fsw.autopilot.flight.state import Aiding, Damage, LostSensor, first_state
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import BatteryState, ConstraintReport, HostHealth, Mode, SensorReport
from tests.fsw.autopilot.flight.contexts import STANDING
from tests.fsw.autopilot.flight.in_flight import CONFIG, limits
from tests.fsw.link.snapshots import REPORT
from tests.fsw.random_states import estimate_of, random_estimate

BLIND = replace(STANDING, estimate_valid=False)
UNCLEAR = replace(STANDING, standing_unclear=True)
TERMINATED = replace(STANDING, mode=Mode.FAULT)
INCONSISTENT = replace(STANDING, inconsistent="the sphere is too small")
NOW_US = 7_000_000
LEVEL = estimate_of(Rotation.identity())._replace(t_us=NOW_US)


def unwell(**changes: Any) -> arming.CommandContext:
    return replace(STANDING, health=replace(STANDING.health, **changes))


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
        (unwell(estimator="no position measurement"), Subject.ESTIMATOR, "no position"),
        (unwell(tilt=math.radians(16.0)), Subject.ATTITUDE, "tilted by 16 deg; 15 deg"),
        (unwell(tilt=math.pi), Subject.ATTITUDE, "tilted by 180 deg"),
        (unwell(tilt=math.nan), Subject.ATTITUDE, "tilted"),
        (unwell(sensor="IMU silent"), Subject.SENSORS, "IMU silent"),
        (UNCLEAR, Subject.STANDING, "neither at rest on the ground nor clearly in the air"),
        (unwell(remaining=0.0), Subject.BATTERY, "0 % left, 10 % needed"),
        (unwell(remaining=math.nan), Subject.BATTERY, "battery"),
        (unwell(parameters="A is below B"), Subject.PARAMETERS, "A is below B"),
        (INCONSISTENT, Subject.SAFE_SET, "the sphere is too small"),
        (unwell(min_margin=-0.02), Subject.SAFE_SET, "outside its safe set by 20 mm"),
        (unwell(joint_rates=(0.0, -2.1)), Subject.JOINTS, "swings"),
        (unwell(joints=(3.0, 0.0)), Subject.JOINTS, "joint 1 at 172 deg is beyond its limit"),
        (unwell(damage="rotor 2 gives nothing"), Subject.ACTUATORS, "rotor 2"),
        (unwell(storage="flight.ulg ends early"), Subject.STORAGE, "flight.ulg ends early"),
    ],
)
def test_each_reason_is_a_sentence_and_force_overrides_all_but_a_missing_estimate(
    context: arming.CommandContext, subject: Subject, words: str
) -> None:
    ((number, sentence),) = arming.failed(context)
    assert arming.CHECKS[number].subject is subject
    assert words in sentence
    assert arming.refusal(context) == f"not armed: {sentence}"
    forced = arming.refusal(context, force=True)
    assert (forced is None) is (context not in (BLIND, TERMINATED))


def test_behind_a_termination_or_a_missing_estimate_nothing_else_is_told() -> None:
    worse = replace(TERMINATED, estimate_valid=False, inconsistent="the sphere is too small")
    for context, told in ((worse, "the flight was terminated"), (BLIND, "the state estimate")):
        refusal = arming.refusal(context) or ""
        assert refusal.startswith(f"not armed: {told}")
        assert arming.refusal(context, force=True) == refusal


def test_every_subject_has_a_check() -> None:
    assert {check.subject for check in arming.CHECKS} == set(Subject)


@pytest.mark.requirement("REQ-ARM-2")
def test_a_vehicle_that_stands_and_is_well_arms_and_all_that_is_not_well_is_said() -> None:
    assert arming.refusal(STANDING) is None
    several = replace(INCONSISTENT, health=replace(STANDING.health, remaining=0.0, tilt=1.0))
    assert (arming.refusal(several) or "").count(";") == 3


def test_only_a_configuration_is_a_reason_that_waiting_does_not_change() -> None:
    assert arming.is_permanent(INCONSISTENT)
    for passing in (
        STANDING,
        replace(INCONSISTENT, estimate_valid=False),
        replace(INCONSISTENT, standing_unclear=True),
        replace(INCONSISTENT, health=replace(STANDING.health, remaining=0.0)),
    ):
        assert not arming.is_permanent(passing)


# ---------------------------------------------------------------- from the state of the vehicle


def healthy(config: FlightConfig = CONFIG, estimate: Any = LEVEL, **state: Any) -> ArmingHealth:
    return arming_health(config, replace(first_state(CONFIG.airframe), **state), estimate, "")


@pytest.mark.requirement("REQ-ARM-3")
@pytest.mark.parametrize("degrees", [0.0, 30.0, 89.0, 180.0])
def test_the_tilt_is_that_of_the_estimate(degrees: float) -> None:
    tilted = estimate_of(Rotation.from_euler("y", degrees, degrees=True))
    assert healthy(estimate=tilted).tilt == pytest.approx(math.radians(degrees), abs=1e-6)


@pytest.mark.requirement("REQ-ARM-3")
def test_an_attitude_that_is_no_number_is_upside_down() -> None:
    lost = random_estimate(np.random.default_rng(2))._replace(R_WB=(math.nan,) * 9)
    assert healthy(estimate=lost).tilt == math.pi


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
    found = healthy(aiding=aiding).estimator
    assert found.startswith(words)
    assert bool(found) is bool(words)


@pytest.mark.requirement("REQ-SAFE-8", "REQ-ARM-4", "REQ-ACT-6")
def test_sensors_margins_damage_and_the_log_are_looked_at() -> None:
    lost = LostSensor(Sensor.ENCODERS, SensorFault.STUCK, NOW_US - 50_000)
    soon = lost._replace(since_us=NOW_US - 49_999)
    for found in ((lost,), (soon._replace(sensor=Sensor.IMU), lost)):
        assert "encoders stuck" in healthy(aiding=Aiding(lost=found)).sensor
    assert healthy(aiding=Aiding(lost=(soon,))).sensor == "", "for a moment"
    for silent_us, words in ((2_400_000, "barometer has been silent for 2 s"), (10**6, "")):
        report = replace(REPORT, sensors=(SensorReport("barometer", silent_us),))
        assert healthy(estimator=report).sensor == words
    assert healthy(constraints=ConstraintReport(margins=(0.2, -0.1))).min_margin == -0.1
    assert healthy(damage=Damage(joint="joint 1 is stuck")).damage == "joint 1 is stuck"
    full = HostHealth(log_failure="flight.ulg ends early: No space left on device")
    assert "No space left" in healthy(host=full).storage
    assert healthy(limits(arm_without_log=1), host=full).storage == ""


@pytest.mark.requirement("REQ-BAT-5")
@pytest.mark.parametrize(("least", "needed"), [(-1.0, 0.1), (0.0, 0.0), (0.4, 0.4)])
def test_the_least_charge_is_a_parameter_and_by_default_the_critical_one(
    least: float, needed: float
) -> None:
    health = healthy(limits(arm_battery=least), battery=BatteryState(remaining=0.07))
    assert (health.remaining, health.min_remaining) == (0.07, needed)
