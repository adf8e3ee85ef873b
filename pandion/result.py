"""The result of a flight out of both halves' parts, as JSON and as a verdict."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

_MPC_KEYS = (
    "horizon",
    "rate_hz",
    "sqp_iterations",
    "p50_us",
    "p99_us",
    "max_us",
    "missed_deadlines",
    "fallbacks",
    "status",
)
_INNER_KEYS = ("rate_hz", "p50_us", "p99_us", "late_share")
_NOTHING: dict[str, float] = {"sum": 0.0, "mean": 0.0}


@dataclass(frozen=True, slots=True)
class Parts:
    """What there is to judge after a flight."""

    scenario: str
    seed: int
    controller: str
    sitl: dict[str, Any] | None  # sitl's result; None if it did not get to write one
    fsw: dict[str, Any] | None  # fsw.json
    failure: str | None  # what a half reported as an error
    logs: dict[str, Path]
    aftermath: str | None = None  # what went wrong when the halves were to end


def as_json(parts: Parts) -> dict[str, Any]:
    """The result with the keys that `docs/` promises, and no others."""
    truth, vehicle = parts.sitl or {}, parts.fsw or {}
    mpc, inner = vehicle.get("mpc", {}), vehicle.get("inner", {})
    return {
        "scenario": parts.scenario,
        "controller": parts.controller,
        "seed": parts.seed,
        "duration_s": truth.get("duration_s", 0.0),
        "completed": bool(truth.get("completed"))
        and parts.failure is None
        and parts.aftermath is None,
        "end_reason": _end_reason(parts),
        "tracking_error_rms_m": truth.get("tracking_error_rms_m"),
        "control_effort": vehicle.get("control_effort", _NOTHING),
        "control_smoothness": vehicle.get("control_smoothness", _NOTHING),
        "margins_m": truth.get("margins_m", {}),
        "min_margin_m": truth.get("min_margin_m"),
        "mpc": {key: mpc.get(key) for key in _MPC_KEYS},
        "inner": {key: inner.get(key) for key in _INNER_KEYS},
        "real_time_factor": truth.get("real_time_factor", 0.0),
        "logs": {name: str(path) for name, path in parts.logs.items()},
    }


def _end_reason(parts: Parts) -> str:
    seen = parts.sitl.get("end_reason") if parts.sitl is not None else None
    reasons = [reason for reason in (parts.failure, seen, parts.aftermath) if reason]
    return "; ".join(reasons) or "the simulator ended without a result"
