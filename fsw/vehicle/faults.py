"""What can go wrong in flight, and the one table that says what is done about it."""

from __future__ import annotations

from enum import Enum

from fsw.frozen import dataclass


class Response(Enum):
    """What the state machine sees of a fault, from mildest to strongest."""

    WARN = 1  # telemetry only
    BRAKE = 2  # stop where the vehicle is, keep trying to plan
    TERMINATE = 3  # outputs to zero


class Fault(Enum):
    """Every fault, named for what the operator reads."""

    PLAN_REFUSED = "last plan refused"
    PLAN_STALE = "no plan for three periods"
    OUTPUT_NOT_FINITE = "actuator command not finite"
    ESTIMATE_INVALID = "state estimate invalid"
    TILT_LOST = "tilt beyond recovery"


RESPONSES: dict[Fault, Response] = {
    Fault.PLAN_REFUSED: Response.WARN,
    Fault.PLAN_STALE: Response.BRAKE,
    Fault.OUTPUT_NOT_FINITE: Response.WARN,
    Fault.ESTIMATE_INVALID: Response.TERMINATE,
    Fault.TILT_LOST: Response.TERMINATE,
}

PLAN_STALE_PERIODS = 3
INVALID_TICKS = 5  # 10 ms without an estimate; a single lost frame is flown through
LEAST_UP = 0.34  # cosine of 70 degrees of tilt


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the detector looks at, once a tick."""

    armed: bool
    flying: bool
    invalid_ticks: int  # since the last valid estimate
    up: float  # cosine of tilt, R33
    plan_age_us: int  # since the running plan (or take-over) began
    plan_period_us: int
    plan_refused: bool
    output_replaced: bool


def detect(evidence: Evidence) -> tuple[Fault, ...]:
    """Active faults, strongest response first."""
    active = []
    if evidence.armed and evidence.invalid_ticks >= INVALID_TICKS:
        active.append(Fault.ESTIMATE_INVALID)
    if evidence.flying and not (evidence.up > LEAST_UP):
        active.append(Fault.TILT_LOST)
    if evidence.flying and evidence.plan_age_us > PLAN_STALE_PERIODS * evidence.plan_period_us:
        active.append(Fault.PLAN_STALE)
    if evidence.output_replaced:
        active.append(Fault.OUTPUT_NOT_FINITE)
    if evidence.plan_refused:
        active.append(Fault.PLAN_REFUSED)
    return tuple(active)
