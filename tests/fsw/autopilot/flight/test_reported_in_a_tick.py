"""Conditions from what a tick is given to what the operator reads, and within which time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.estimation.estimator import estimate_state
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.failsafe.table import ROWS
from fsw.autopilot.flight.plan_exchange import nominal_at_rest
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.state import FlightState, MissionMemory, PlanMemory
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import (
    BatteryState,
    BatteryWarning,
    Mode,
    PlanFailure,
    PlanTimings,
    SafeSet,
    SolverStatus,
    Zone,
)
from tests.fsw.autopilot.flight.failsafe.test_response import Watched
from tests.fsw.autopilot.flight.in_flight import CONFIG, flying
from tests.fsw.autopilot.flight.test_autopilot import frame, tick
from tests.fsw.records import with_record

BEGIN_US = 1_002_000  # just after the table was looked at
IN_THE_AIR = frame(BEGIN_US, p_WB=(0.5, 0.0, -3.0))
AHEAD = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1),))  # the base is to stay at x < 0.9
NO_PLAN = PlanFailure(1, SolverStatus.INFEASIBLE, "no", PlanTimings(0.0, 0.0, 0.0))
ASKED = PlanMemory(since_us=BEGIN_US, awaited_id=1, awaited_us=BEGIN_US)
Inputs = Callable[[int], dict[str, Any]]


def hovering(**changes: Any) -> FlightState:
    """Half a metre from a wall, on its plan."""
    seen = estimate_state(IN_THE_AIR)
    assert seen is not None
    given = {
        "mission": MissionMemory(safe_set=AHEAD, announced=AHEAD),
        "plan": PlanMemory(since_us=BEGIN_US),
        **changes,
    }
    nominal = given.pop("plan_state", nominal_at_rest(seen))
    kept = InflatedSafeSet().of(given["mission"].safe_set)
    return replace(
        with_record(flying(), plan_state=nominal),
        index=0,
        t_us=BEGIN_US - 2_000,
        kept=kept,
        **given,
    )


def told_after_us(
    state: FlightState, condition: Condition, inputs: Inputs, until_us: int = 110_000
) -> float:
    """Time from the first tick to the report [us]; infinite where there is none ``until_us``."""
    for t_us in range(BEGIN_US, BEGIN_US + until_us, 2_000):
        given = {"sensors": replace(IN_THE_AIR, t_us=t_us), **inputs(t_us)}
        state, outputs = tick(state, t_us, **given)
        if any(condition.value in text.text for text in outputs.texts):
            return t_us - BEGIN_US
    return math.inf


def faster(speed: float) -> Inputs:
    return lambda t_us: {"sensors": replace(IN_THE_AIR, t_us=t_us, v_WB=(speed, 0.0, 0.0))}


def refused_once(t_us: int) -> dict[str, Any]:
    return {"plan": NO_PLAN} if t_us == BEGIN_US else {}


def jumped(by_us: int) -> Inputs:
    return lambda t_us: {"sensors": replace(IN_THE_AIR, t_us=t_us + by_us)}


def clock_jumped(t_us: int) -> dict[str, Any]:
    return {"sensor_clock_jump_us": -500_000} if t_us == BEGIN_US else {}


def nothing(_: int) -> dict[str, Any]:
    return {}


@pytest.mark.requirement("REQ-SAFE-5", "REQ-PLAN-1", "REQ-MODE-1")
@pytest.mark.parametrize(
    ("condition", "state", "inputs"),
    [
        (Condition.FILTER_ACTIVE, hovering(), faster(1.5)),
        (Condition.PLAN_LATE, hovering(plan=ASKED), nothing),
        (Condition.PLAN_REFUSED, hovering(plan=ASKED), refused_once),
        (Condition.TIME_JUMPED, hovering(), jumped(50_000)),
        (Condition.TIME_JUMPED, hovering(), jumped(-4_000)),
        (Condition.TIME_JUMPED, hovering(), clock_jumped),
    ],
    ids=["too fast", "late", "refused", "ahead", "back", "clock"],
)
def test_what_a_tick_is_given_is_reported_within_the_time_of_its_row(
    condition: Condition, state: FlightState, inputs: Inputs
) -> None:
    assert told_after_us(state, condition, inputs) <= ROWS[condition].within_us
    assert told_after_us(hovering(), condition, faster(0.1)) == math.inf


PERSON = Zone(
    ball((9.0, 0.0, -1.0), 0.3),
    0.1,
    velocity=(0.0, 0.5, 0.0),
    t_us=BEGIN_US - CONFIG.limits.zone_timeout_us,
)
SILENT = SafeSet((PERSON,))


@pytest.mark.requirement("REQ-SAFE-10", "REQ-BAT-1", "REQ-BAT-2", "REQ-BAT-3", "REQ-MODE-1")
@pytest.mark.parametrize("index", [0, 1, 2, 25, 49])
@pytest.mark.parametrize(
    ("condition", "state"),
    [
        (
            Condition.ZONES_SILENT,
            hovering(mission=MissionMemory(safe_set=SILENT, announced=SILENT)),
        ),
        (Condition.BATTERY_LOW, hovering(battery=BatteryState(consumed=8.1))),
        (Condition.BATTERY_CRITICAL, hovering(battery=BatteryState(consumed=9.1))),
        (Condition.BATTERY_EMERGENCY, hovering(battery=BatteryState(consumed=9.6))),
    ],
    ids=["silent zone", "low", "critical", "nearly empty"],
)
def test_what_is_found_once_a_period_is_reported_in_time_in_any_phase(
    condition: Condition, state: FlightState, index: int
) -> None:
    """Planning ticks and looks at the table are not the same ticks."""
    shifted = replace(state, index=index)
    assert told_after_us(shifted, condition, nothing, 250_000) <= ROWS[condition].within_us


@pytest.mark.requirement("REQ-BAT-2", "REQ-BAT-3", "REQ-BAT-4")
@pytest.mark.parametrize(
    ("battery", "mode"),
    [
        (BatteryState(remaining=0.09, charge=BatteryWarning.CRITICAL), Mode.RETURN),
        (BatteryState(remaining=0.04, charge=BatteryWarning.EMERGENCY), Mode.LAND),
        (BatteryState(time_left=20.0), Mode.RETURN),
    ],
    ids=["critical", "nearly empty", "flight time"],
)
def test_a_battery_that_ends_holds_for_five_seconds_and_then_brings_the_vehicle_down(
    battery: BatteryState, mode: Mode
) -> None:
    watched = Watched().heard().until(1.0)
    assert watched.heard().until(1.1, battery=battery).flown == (Mode.HOLD, Mode.MISSION)
    assert watched.until(6.0).flown == (Mode.HOLD, Mode.MISSION)
    assert watched.until(6.2).flown == (mode, Mode.MISSION)


@pytest.mark.requirement("REQ-SAFE-3")
@pytest.mark.parametrize(("off", "left"), [(0.08, False), (0.15, True)])
def test_off_the_tube_is_reported_and_the_next_plan_starts_from_the_measurement(
    off: float, left: bool
) -> None:
    seen = estimate_state(IN_THE_AIR)
    assert seen is not None
    x, y, z = seen.p_WB
    state = hovering(plan_state=nominal_at_rest(seen)._replace(p=(x - off, y, z)))
    told_us, request = math.inf, None
    for t_us in range(BEGIN_US, BEGIN_US + 110_000, 2_000):
        state, outputs = tick(state, t_us, sensors=replace(IN_THE_AIR, t_us=t_us))
        if any("off the plan by 150 mm: replanning" in text.text for text in outputs.texts):
            told_us = t_us - BEGIN_US
        request = outputs.plan_request or request
    assert (told_us <= ROWS[Condition.TUBE_LEFT].within_us) is left
    assert request is not None
    assert request.from_nominal is not left
    assert request.start.p[0] == pytest.approx(x if left else x - off, abs=0.01)
