"""The flight software's part of a run's result: `fsw.json`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from fsw.ports import VehicleFacts
from fsw.runtime.planner_worker import PlannerRecord
from fsw.runtime.rates import HOUSEKEEPING, INNER, TELEMETRY
from fsw.runtime.sim_loop import FlightEnd, FlightRecord
from fsw.runtime.timing import GroupTimer, Histogram


@dataclass(frozen=True, slots=True)
class Setup:
    """What was flown with."""

    controller: str
    inner: str
    facts: VehicleFacts


def as_json(
    setup: Setup, end: FlightEnd, record: FlightRecord, retransmissions: int
) -> dict[str, object]:
    """The result as it is written; times in microseconds."""
    for timer in record.groups.values():
        timer.close_interval()
    record.mpc.timer.close_interval()
    return {
        "controller": setup.controller,
        "inner_loop": setup.inner,
        "end": end.ending.value,
        "end_reason": end.sentence,
        **record.effort.as_json(),
        "mpc": _mpc(setup.facts, record),
        "inner": {
            **_group(record.groups[INNER.name]),
            "stale": record.stale,
            "begun_us": record.begun_us,
            "missed_us": record.missed.stretches,
        },
        "telemetry": _group(record.groups[TELEMETRY.name]),
        "housekeeping": _group(record.groups[HOUSEKEEPING.name]),
        "scheduler": record.scheduler,
        "stages": {name: _percentiles(times) for name, times in record.stages.items()},
        "setpoints": {
            "accepted": record.offboard.accepted,
            "refused": record.offboard.refused,
        },
        "retransmissions": retransmissions,
    }


def write(path: Path, result: dict[str, object]) -> str | None:
    """Write the result as one JSON object; returns why that was not possible."""
    try:
        path.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        return f"{path}: {error.strerror}"
    return None


def _mpc(facts: VehicleFacts, record: FlightRecord) -> dict[str, object]:
    planner: PlannerRecord = record.mpc
    timer = planner.timer
    return {
        "horizon": facts.horizon,
        "rate_hz": 1e6 / facts.mpc_period_us,
        "sqp_iterations": facts.sqp_iterations,
        "cycles": timer.execution.count,
        **_percentiles(timer.execution),
        "lateness_p99_us": timer.lateness.percentile_us(0.99),
        "missed_deadlines": record.counters.missed_deadlines,
        "fallbacks": record.counters.fallbacks,
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
