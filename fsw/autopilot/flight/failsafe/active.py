"""Which rows of the failsafe table are active; almost always none, which a short look tells."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.failsafe.evidence import (
    INVALID_TICKS,
    PLAN_STALE_PERIODS,
    FailsafeContext,
)
from fsw.autopilot.flight.failsafe.table import FAILSAFES, Evidence, Failsafe
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import Mode, StateEstimate

_OFFBOARD: Final = Mode.OFFBOARD
_TESTS: Final = tuple((row.active, row) for row in FAILSAFES)
_QUICK: Final = tuple((row.active, row) for row in FAILSAFES if not row.slow)
# What ``all_is_well`` rules out. A row that is not here is asked in every tick.
_RULED_OUT: Final = frozenset(
    {
        Condition.ATTITUDE_LOST,
        Condition.TILT_LOST,
        Condition.POSITION_LOST,
        Condition.BREACH,
        Condition.FENCE_BREACH,
        Condition.GROUND_CONTACT,
        Condition.ROTOR_LOST,
        Condition.POSITION_LOW,
        Condition.SENSOR_LOST,
        Condition.TUBE_LEFT,
        Condition.FILTER_ACTIVE,
        Condition.PLAN_STALE,
        Condition.AIDING_LOST,
        Condition.ESTIMATE_INVALID,
        Condition.OUTPUT_NOT_FINITE,
        Condition.PLAN_REFUSED,
        Condition.PLAN_LATE,
        Condition.SETPOINTS_LOST,
    }
)
_OTHERS: Final = tuple(one for one in _TESTS if one[1].condition not in _RULED_OUT)
_QUICK_OTHERS: Final = tuple(one for one in _QUICK if one[1].condition not in _RULED_OUT)
_SLOW: Final = frozenset(row.condition for row in FAILSAFES if row.slow)


def active(context: FailsafeContext) -> tuple[Failsafe, ...]:
    """Rows whose condition is active, in the order of the table; almost always none."""
    well = all_is_well(context.state, context.estimate, context.config)
    return _found(context, _OTHERS if well else _TESTS)


def quickly_active(context: FailsafeContext) -> tuple[Failsafe, ...]:
    """The same between two planning periods: the slow rows are as they were found last."""
    well = all_is_well(context.state, context.estimate, context.config)
    found = _found(context, _QUICK_OTHERS if well else _QUICK)
    before = context.state.vehicle.conditions
    if before and not _SLOW.isdisjoint(before):
        known = {row.condition for row in found} | _SLOW.intersection(before)
        found = tuple([row for row in FAILSAFES if row.condition in known])
    return found


def surely_none(state: FlightState, estimate: StateEstimate, config: FlightConfig) -> bool:
    """Whether none can be active between two planning periods, known without asking any row."""
    return (
        not state.vehicle.conditions and not _QUICK_OTHERS and all_is_well(state, estimate, config)
    )


def all_is_well(state: FlightState, estimate: StateEstimate, config: FlightConfig) -> bool:
    """Whether no condition of ``_RULED_OUT`` can be active, as in nearly every tick.

    False says nothing: the rows decide. Tests hold it against each of them.
    """
    vehicle, limits, aiding = state.vehicle, config.limits, state.aiding
    safety, plan = state.safety, state.plan
    plan_age_us = estimate.t_us - plan.since_us
    return (
        aiding.unaided_us < limits.aiding_loss_us
        and not aiding.lost
        and aiding.attitude_sigma <= limits.attitude_loss
        and safety.rolled_us < 0
        and safety.pitched_us < 0
        and safety.light_us < 0
        and safety.breach_us < 0
        and safety.fence_us < 0
        and safety.off_plan_us < 0
        and safety.filter_us < 0
        and not state.damage.report.lost
        and plan_age_us <= PLAN_STALE_PERIODS * config.planner.period_us
        and not plan.refused
        and not plan.awaited_missed
        and state.invalid_ticks < INVALID_TICKS
        and not state.output_replaced
        and vehicle.mode is not _OFFBOARD
        and vehicle.failsafe_from is not _OFFBOARD
    )


def _found(
    context: FailsafeContext, tests: tuple[tuple[Evidence, Failsafe], ...]
) -> tuple[Failsafe, ...]:
    found: tuple[Failsafe, ...] = ()
    for is_active, row in tests:
        if is_active(context):
            found = (*found, row)
    return found
