"""The arming checks: one table. Each has a subject, as PX4's health report groups them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final

from fsw.autopilot.estimation.faults.sensor_fault import sentence
from fsw.autopilot.flight.land_detector import standing_unclear
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.geometry.vectors import clamp_magnitude
from fsw.autopilot.model.arm_coordinates import first_beyond
from fsw.autopilot.signals import Mode

_INVALID: Final = "the state estimate is invalid"
_SWINGING: Final = 2.0  # rad/s of a joint
_BEYOND: Final = 0.1  # rad that a joint may be beyond its limit: it rests on its end stop
_DENIES: Final = 2  # of COM_ARM_SDCARD
_SILENT_US: Final = 1_000_000
_KNOWN_ANGLE: Final = 0.2  # rad, standard deviation of roll and pitch that telemetry calls known


class Subject(Enum):
    """What a check is about."""

    TERMINATION = "termination"
    ESTIMATOR = "estimator"
    ATTITUDE = "attitude"
    SENSORS = "sensors"
    STANDING = "place"
    BATTERY = "battery"
    PARAMETERS = "parameters"
    SAFE_SET = "safe set"
    JOINTS = "joints"
    ACTUATORS = "actuators"
    STORAGE = "storage"


@dataclass(frozen=True, slots=True)
class ArmingCheck:
    """One row: empty where the check passes."""

    subject: Subject
    summary: str  # what is wrong, in words that never change
    refusal: Callable[[Situation], str]
    permanent: bool = False  # waiting does not help
    final: bool = False  # where it fails nothing else is worth a look, and force does not help


def _terminated(context: Situation) -> str:
    ended = context.mode is Mode.FAULT
    return "the flight was terminated; restart the flight software" if ended else ""


def _estimate(context: Situation) -> str:
    return "" if context.estimate_is_valid else _INVALID


def _aiding(context: Situation) -> str:
    aiding = context.state.aiding
    if aiding.unaided_us >= context.limits.aiding_loss_us:
        return f"no position measurement: {sentence(aiding.pose, aiding.pose_fault)}"
    if not aiding.attitude_sigma <= _KNOWN_ANGLE:
        degrees = math.degrees(aiding.attitude_sigma)
        return f"roll and pitch are known to {degrees:.0f} deg only"
    return ""


def _attitude(context: Situation) -> str:
    upright, most = context.estimate.R_WB[8], math.degrees(context.limits.arm_tilt)
    known = upright == upright
    tilt = math.degrees(math.acos(clamp_magnitude(upright, 1.0))) if known else 180.0
    if tilt <= most:
        return ""
    return f"the vehicle is tilted by {tilt:.0f} deg; {most:.0f} deg are allowed"


def _sensors(context: Situation) -> str:
    """The first that has been of no use for COM_SENS_LOSS_T, or was there and is silent."""
    since_us = context.estimate.t_us - context.limits.sensor_loss_us
    for lost in context.state.aiding.lost:
        if lost.since_us <= since_us:
            return sentence(lost.sensor, lost.fault)
    report = context.state.estimator
    for one in report.sensors if report is not None else ():
        if one.silent_us > _SILENT_US:
            return f"{one.name} has been silent for {1e-6 * one.silent_us:.0f} s"
    return ""


def _standing(context: Situation) -> str:
    if not standing_unclear(context.config, context.estimate):
        return ""
    return "neither at rest on the ground nor clearly in the air; wait, or check the height"


def _battery(context: Situation) -> str:
    remaining, limits = context.state.battery.remaining, context.limits
    least = limits.arm_battery if limits.arm_battery >= 0.0 else limits.battery_critical
    if remaining >= least:
        return ""
    left = f"{100 * remaining:.0f} % left, {100 * least:.0f} % needed"
    return f"the battery is nearly empty: {left}"


def _outside(context: Situation) -> str:
    margin = min(context.state.constraints.margins, default=math.inf)
    if margin >= 0.0:
        return ""
    return f"the vehicle is outside its safe set by {-1e3 * margin:.0f} mm"


def _joints(context: Situation) -> str:
    joints, rates = context.estimate.q_arm, context.estimate.qd_arm
    if not all(abs(rate) <= _SWINGING for rate in rates):
        return "the arm swings; wait until it hangs still"
    return first_beyond(context.config.airframe.angle_limits, joints, _BEYOND) or ""


def _storage(context: Situation) -> str:
    failure = context.state.host.log_failure
    if not failure or context.limits.arm_without_log < _DENIES:
        return ""
    return f"{failure}; free the disk and start again"


CHECKS: Final = (
    ArmingCheck(
        Subject.TERMINATION, "The flight was terminated", _terminated, permanent=True, final=True
    ),
    ArmingCheck(Subject.ESTIMATOR, "The state estimate is invalid", _estimate, final=True),
    ArmingCheck(
        Subject.ESTIMATOR,
        "The position is not measured, or the attitude not known",
        _aiding,
    ),
    ArmingCheck(Subject.ATTITUDE, "The vehicle is tilted", _attitude),
    ArmingCheck(Subject.SENSORS, "A sensor fails", _sensors),
    ArmingCheck(
        Subject.STANDING, "The vehicle is neither on the ground nor clearly in the air", _standing
    ),
    ArmingCheck(Subject.BATTERY, "The battery is nearly empty", _battery),
    ArmingCheck(
        Subject.PARAMETERS,
        "Parameters contradict each other",
        lambda c: c.against,
        permanent=True,
    ),
    ArmingCheck(
        Subject.SAFE_SET,
        "The safe set cannot be kept",
        lambda c: "; ".join(c.mission.refusals),
        permanent=True,
    ),
    ArmingCheck(Subject.SAFE_SET, "The vehicle is outside its safe set", _outside),
    ArmingCheck(Subject.JOINTS, "The arm swings, or is beyond its limits", _joints),
    ArmingCheck(
        Subject.ACTUATORS,
        "A rotor or a joint has failed",
        lambda c: c.state.damage.rotor or c.state.damage.joint,
    ),
    ArmingCheck(Subject.STORAGE, "The flight log is not written", _storage, permanent=True),
)

Failed = tuple[tuple[int, str], ...]
"""What speaks against arming: the check's place in the table, and a sentence."""
NO_ESTIMATE: Final = (
    next(number for number, check in enumerate(CHECKS) if check.refusal is _estimate),
    _INVALID,
)
"""What speaks against it before the first estimate, when nothing else can be looked at."""


def failed(context: Situation) -> Failed:
    """The checks that fail, up to the first one that is final."""
    found: list[tuple[int, str]] = []
    for number, check in enumerate(CHECKS):
        sentence = check.refusal(context)
        if sentence:
            found.append((number, sentence))
            if check.final:
                break
    return tuple(found)


def joined(found: Failed) -> str:
    """All that speaks against arming, as the operator reads it, each once."""
    said = [sentence for _, sentence in found]
    return "not armed: " + "; ".join(
        one for k, one in enumerate(said) if not any(one in other for other in said[k + 1 :])
    )


def refusal(context: Situation, *, force: bool = False) -> str | None:
    """Why the vehicle cannot be armed now; force overrides all checks that are not final."""
    found = failed(context)
    if force:
        found = tuple([(number, why) for number, why in found if CHECKS[number].final])
    return joined(found) if found else None


def is_permanent(context: Situation) -> bool:
    """Whether nothing but the configuration prevents arming, so that waiting does not help."""
    reasons = [check.permanent for check in CHECKS if check.refusal(context)]
    return bool(reasons) and all(reasons)
