"""The arming checks: one table. Each has a subject, as PX4's health report groups them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final

from fsw.autopilot.flight.modes.base import CommandContext
from fsw.autopilot.model.arm_coordinates import first_beyond
from fsw.autopilot.signals import Mode

_INVALID: Final = "the state estimate is invalid"
_SWINGING: Final = 2.0  # rad/s of a joint
_BEYOND: Final = 0.1  # rad that a joint may be beyond its limit: it rests on its end stop


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
    refusal: Callable[[CommandContext], str]
    permanent: bool = False  # waiting does not help
    final: bool = False  # where it fails nothing else is worth a look, and force does not help


def _terminated(context: CommandContext) -> str:
    ended = context.mode is Mode.FAULT
    return "the flight was terminated; restart the flight software" if ended else ""


def _estimate(context: CommandContext) -> str:
    return "" if context.estimate_valid else _INVALID


def _attitude(context: CommandContext) -> str:
    tilt, most = map(math.degrees, (context.health.tilt, context.config.limits.arm_tilt))
    if tilt <= most:
        return ""
    return f"the vehicle is tilted by {tilt:.0f} deg; {most:.0f} deg are allowed"


def _standing(context: CommandContext) -> str:
    if not context.standing_unclear:
        return ""
    return "neither at rest on the ground nor clearly in the air; wait, or check the height"


def _battery(context: CommandContext) -> str:
    remaining, least = context.health.remaining, context.health.min_remaining
    if remaining >= least:
        return ""
    left = f"{100 * remaining:.0f} % left, {100 * least:.0f} % needed"
    return f"the battery is nearly empty: {left}"


def _outside(context: CommandContext) -> str:
    margin = context.health.min_margin
    if margin >= 0.0:
        return ""
    return f"the vehicle is outside its safe set by {-1e3 * margin:.0f} mm"


def _joints(context: CommandContext) -> str:
    joints, rates = context.health.joints, context.health.joint_rates
    if not all(abs(rate) <= _SWINGING for rate in rates):
        return "the arm swings; wait until it hangs still"
    return first_beyond(context.config.airframe.angle_limits, joints, _BEYOND) or ""


def _storage(context: CommandContext) -> str:
    failure = context.health.storage
    return f"{failure}; free the disk and start again" if failure else ""


CHECKS: Final = (
    ArmingCheck(
        Subject.TERMINATION, "The flight was terminated", _terminated, permanent=True, final=True
    ),
    ArmingCheck(Subject.ESTIMATOR, "The state estimate is invalid", _estimate, final=True),
    ArmingCheck(
        Subject.ESTIMATOR,
        "The position is not measured, or the attitude not known",
        lambda c: c.health.estimator,
    ),
    ArmingCheck(Subject.ATTITUDE, "The vehicle is tilted", _attitude),
    ArmingCheck(Subject.SENSORS, "A sensor fails", lambda c: c.health.sensor),
    ArmingCheck(
        Subject.STANDING, "The vehicle is neither on the ground nor clearly in the air", _standing
    ),
    ArmingCheck(Subject.BATTERY, "The battery is nearly empty", _battery),
    ArmingCheck(
        Subject.PARAMETERS,
        "Parameters contradict each other",
        lambda c: c.health.parameters,
        permanent=True,
    ),
    ArmingCheck(
        Subject.SAFE_SET, "The safe set cannot be kept", lambda c: c.inconsistent, permanent=True
    ),
    ArmingCheck(Subject.SAFE_SET, "The vehicle is outside its safe set", _outside),
    ArmingCheck(Subject.JOINTS, "The arm swings, or is beyond its limits", _joints),
    ArmingCheck(Subject.ACTUATORS, "A rotor or a joint has failed", lambda c: c.health.damage),
    ArmingCheck(Subject.STORAGE, "The flight log is not written", _storage, permanent=True),
)

Failed = tuple[tuple[int, str], ...]
"""What speaks against arming: the check's place in the table, and a sentence."""
NO_ESTIMATE: Final = (
    next(number for number, check in enumerate(CHECKS) if check.refusal is _estimate),
    _INVALID,
)
"""What speaks against it before the first estimate, when nothing else can be looked at."""


def failed(context: CommandContext) -> Failed:
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


def refusal(context: CommandContext, *, force: bool = False) -> str | None:
    """Why the vehicle cannot be armed now; force overrides all checks that are not final."""
    found = failed(context)
    if force:
        found = tuple([(number, why) for number, why in found if CHECKS[number].final])
    return joined(found) if found else None


def is_permanent(context: CommandContext) -> bool:
    """Whether nothing but the configuration prevents arming, so that waiting does not help."""
    reasons = [check.permanent for check in CHECKS if check.refusal(context)]
    return bool(reasons) and all(reasons)
