"""The flight software's part of a run's result: `fsw.json`."""

from __future__ import annotations

from dataclasses import asdict

from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.autopilot.ports import VehicleFacts
from fsw.autopilot.signals import OffboardReport, PlannerCounters, SafetyCounters
from fsw.runtime.flight_loop import FlightEnd, FlightRecord
from fsw.runtime.rate_groups import HOUSEKEEPING, INNER, TELEMETRY
from fsw.runtime.timing import GroupTimer, Histogram


def as_json(
    control: ControlChoice, facts: VehicleFacts, end: FlightEnd, record: FlightRecord
) -> dict[str, object]:
    """What was flown with, how it ended and what the loop measured; times in microseconds."""
    for timer in record.groups.values():
        timer.close_interval()
    record.mpc.timer.close_interval()
    seen = record.snapshot
    safety = SafetyCounters() if seen is None else seen.safety
    setpoints = OffboardReport() if seen is None else seen.offboard
    return {
        "controller": control.controller,
        "inner_loop": control.inner,
        "end": end.ending.value,
        "end_reason": end.sentence,
        **record.control.as_json(),
        "mpc": _mpc(facts, record),
        "inner": {
            **_group(record.groups[INNER.name]),
            "stale": record.stale,
            "begun_us": record.begun_us,
            "missed_us": record.deadlines.missed,
        },
        "telemetry": _group(record.groups[TELEMETRY.name]),
        "housekeeping": _group(record.groups[HOUSEKEEPING.name]),
        "scheduler": record.scheduler,
        "stages": {name: _percentiles(times) for name, times in record.stages.items()},
        "safety": asdict(safety),
        "setpoints": {"accepted": setpoints.accepted, "refused": setpoints.refused},
    }


def _mpc(facts: VehicleFacts, record: FlightRecord) -> dict[str, object]:
    planner, seen = record.mpc, record.snapshot
    timer, counters = planner.timer, PlannerCounters() if seen is None else seen.counters
    return {
        "horizon": facts.horizon,
        "rate_hz": 1e6 / facts.mpc_period_us,
        "sqp_iterations": facts.sqp_iterations,
        "cycles": timer.execution.count,
        **_percentiles(timer.execution),
        "lateness_p99_us": timer.lateness.percentile_us(0.99),
        "missed_deadlines": counters.missed_deadlines,
        "fallbacks": counters.fallbacks,
        "restarts": planner.restarts,
        "status": dict(planner.status),
    }


def _group(timer: GroupTimer) -> dict[str, object]:
    lateness = timer.lateness
    return {
        "rate_hz": 1e6 / timer.period_us,
        "ticks": timer.ticks,
        **_percentiles(timer.execution),
        "late": timer.late,
        "late_share": timer.late_share,
        "skipped": timer.skipped,
        "lateness_p50_us": lateness.percentile_us(0.50),
        "lateness_p99_us": lateness.percentile_us(0.99),
        "lateness_max_us": lateness.max_us,
    }


def _percentiles(times: Histogram) -> dict[str, float]:
    return {
        "p50_us": times.percentile_us(0.50),
        "p99_us": times.percentile_us(0.99),
        "max_us": times.max_us,
    }
