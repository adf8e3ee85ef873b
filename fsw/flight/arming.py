"""The arming checks: one table. Each has a subject, as PX4's health report groups them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final

from fsw.flight.modes.base import CommandContext

_SWINGING: Final = 2.0  # rad/s of a joint
_BEYOND: Final = 0.1  # rad that a joint may be beyond its limit: it rests on its end stop


class Subject(Enum):
    """What a check is about."""

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
    refusal: Callable[[CommandContext], str]
    permanent: bool = False  # waiting does not help


def _estimate(context: CommandContext) -> str:
    return "" if context.estimate_valid else "the state estimate is invalid"


def _attitude(context: CommandContext) -> str:
    tilt, most = (math.degrees(x) for x in (context.health.tilt, context.health.most_tilt))
    if tilt <= most:
        return ""
    return f"the vehicle is tilted by {tilt:.0f} deg; {most:.0f} deg are allowed"


def _standing(context: CommandContext) -> str:
    if not context.standing_unclear:
        return ""
    return "neither at rest on the ground nor clearly in the air; check the height"


def _battery(context: CommandContext) -> str:
    remaining, least = context.health.remaining, context.health.least_remaining
    if remaining >= least:
        return ""
    left = f"{100 * remaining:.0f} % left, {100 * least:.0f} % needed"
    return f"the battery is nearly empty: {left}"


def _outside(context: CommandContext) -> str:
    margin = context.health.least_margin
    if margin >= 0.0:
        return ""
    return f"the vehicle is outside its safe set by {-1e3 * margin:.0f} mm"


def _joints(context: CommandContext) -> str:
    (q1, q2), rates = context.health.joints, context.health.joint_rates
    airframe = context.airframe
    if not max(abs(rates[0]), abs(rates[1])) <= _SWINGING:
        return "the arm swings; wait until it hangs still"
    first, both = airframe.joint1_limit + _BEYOND, airframe.joint12_limit + _BEYOND
    if abs(q1) <= first and abs(q1 + q2) <= both:
        return ""
    return f"the joints are beyond their limits, at {q1:.2f} and {q2:.2f} rad"


def _storage(context: CommandContext) -> str:
    failure = context.health.storage
    return f"{failure}; free the disk and start again" if failure else ""


CHECKS: Final = (
    ArmingCheck(Subject.ESTIMATOR, _estimate),
    ArmingCheck(Subject.ESTIMATOR, lambda c: c.health.estimator),
    ArmingCheck(Subject.ATTITUDE, _attitude),
    ArmingCheck(Subject.SENSORS, lambda c: c.health.sensor),
    ArmingCheck(Subject.STANDING, _standing),
    ArmingCheck(Subject.BATTERY, _battery),
    ArmingCheck(Subject.PARAMETERS, lambda c: c.health.parameters, permanent=True),
    ArmingCheck(Subject.SAFE_SET, lambda c: c.inconsistent, permanent=True),
    ArmingCheck(Subject.SAFE_SET, _outside),
    ArmingCheck(Subject.JOINTS, _joints),
    ArmingCheck(Subject.ACTUATORS, lambda c: c.health.damage),
    ArmingCheck(Subject.STORAGE, _storage, permanent=True),
)

Failed = tuple[tuple[Subject, str], ...]
"""What speaks against arming, a sentence each."""


def failed(context: CommandContext) -> Failed:
    """The checks that fail; behind an invalid estimate nothing is worth a look."""
    found: list[tuple[Subject, str]] = []
    for check in CHECKS:
        sentence = check.refusal(context)
        if sentence:
            found.append((check.subject, sentence))
            if not context.estimate_valid:
                break
    return tuple(found)


def refusal(context: CommandContext, *, force: bool = False) -> str | None:
    """Why the vehicle cannot be armed now; force overrides all but a missing estimate."""
    if force and context.estimate_valid:
        return None
    found = failed(context)
    return "not armed: " + "; ".join(sentence for _, sentence in found) if found else None


def is_permanent(context: CommandContext) -> bool:
    """Whether nothing but the configuration prevents arming, so that waiting does not help."""
    reasons = [check.permanent for check in CHECKS if check.refusal(context)]
    return bool(reasons) and all(reasons)
