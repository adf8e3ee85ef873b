"""The result of a flight from the reports of both processes, as JSON and as a table."""

from __future__ import annotations

import math
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
_SAFETY_KEYS = ("breaches", "departures", "interventions")
_NOTHING: dict[str, float] = {"sum": 0.0, "mean": 0.0}


@dataclass(frozen=True, slots=True)
class FlightReports:
    """Inputs to the result of a flight."""

    scenario: str
    seed: int
    controller: str
    sitl: dict[str, Any] | None  # sitl's result; None if it did not get to write one
    fsw: dict[str, Any] | None  # fsw.json
    failure: str | None  # what a process reported as an error
    logs: dict[str, Path]
    aftermath: str | None = None  # what went wrong after the flight
    unwritten: tuple[str, ...] = ()  # what both processes could not write, and why


def as_json(reports: FlightReports) -> dict[str, Any]:
    """The result with the keys that `docs/` promises, and no others."""
    truth, vehicle = reports.sitl or {}, reports.fsw or {}
    mpc, inner = vehicle.get("mpc", {}), vehicle.get("inner", {})
    return {
        "scenario": reports.scenario,
        "controller": reports.controller,
        "seed": reports.seed,
        "vehicle": truth.get("vehicle"),
        "sensors": truth.get("sensors"),
        "duration_s": truth.get("duration_s", 0.0),
        "completed": bool(truth.get("completed"))
        and reports.failure is None
        and reports.aftermath is None,
        "end_reason": _end_reason(reports),
        "tracking_error_rms_m": truth.get("tracking_error_rms_m"),
        "control_effort": vehicle.get("control_effort", _NOTHING),
        "control_smoothness": vehicle.get("control_smoothness", _NOTHING),
        "margins_m": truth.get("margins_m", {}),
        "min_margin_m": truth.get("min_margin_m"),
        "limits": truth.get("limits", {}),
        "touches": truth.get("touches", {}),
        "force_error_rms_n": truth.get("force_error_rms_n"),
        "force_asked_rms_n": truth.get("force_asked_rms_n"),
        "payload": truth.get("payload"),
        "surfaces_m": truth.get("surfaces_m", {}),
        "beyond_s": truth.get("beyond_s", {}),
        "safety": {key: vehicle.get("safety", {}).get(key) for key in _SAFETY_KEYS},
        "mpc": {key: mpc.get(key) for key in _MPC_KEYS},
        "inner": {key: inner.get(key) for key in _INNER_KEYS},
        "real_time_factor": truth.get("real_time_factor", 0.0),
        "logs": {name: str(path) for name, path in reports.logs.items()},
        "unwritten": list(reports.unwritten),
    }


def _end_reason(reports: FlightReports) -> str:
    seen = reports.sitl.get("end_reason") if reports.sitl is not None else None
    reasons = [reason for reason in (reports.failure, seen, reports.aftermath) if reason]
    return "; ".join(reasons) or "the simulator ended without a result"


Rows = list[tuple[str, str]]


def first_rows(result: dict[str, Any], tracking_max_m: float | None) -> Rows:
    """What a flight comes down to, as text; ``tracking_max_m`` [m] is not in the JSON."""
    margins = {name: value for name, value in result["margins_m"].items() if value is not None}
    of = f", {min(margins, key=margins.__getitem__)}" if margins else ""
    return [
        ("minimum margin", f"{_mm(result['min_margin_m'])}{of}"),
        *[(f"force on {name}", _pressed(use)) for name, use in result["touches"].items()],
        *_payload_row(result["payload"]),
        *_asked_row(result["force_error_rms_n"], result["force_asked_rms_n"]),
        ("tracking RMS / max", f"{_mm(result['tracking_error_rms_m'])} / {_mm(tracking_max_m)}"),
    ]


def table_rows(result: dict[str, Any], tracking_max_m: float | None) -> Rows:
    """All of a flight, as text; ``tracking_max_m`` [m] is not in the JSON."""
    return [
        *first_rows(result, tracking_max_m),
        ("flown", f"{result['duration_s']:.1f} s"),
        ("vehicle", result["vehicle"] or "unknown"),
        ("sensors", result["sensors"] or "unknown"),
        *[(f"margin {name}", _mm(value)) for name, value in _shown(result["margins_m"]).items()],
        *[(f"limit {name.replace('_', ' ')}", _use(use)) for name, use in result["limits"].items()],
        ("longest beyond a surface", f"{max(result['beyond_s'].values(), default=0.0):.3f} s"),
        ("control effort, sum / mean", _sum_and_mean(result["control_effort"])),
        ("control smoothness, sum / mean", _sum_and_mean(result["control_smoothness"])),
        ("breaches / off plan / filter", _counts(result["safety"])),
        *_timing_rows(result["mpc"], result["inner"]),
        ("real-time factor", f"{result['real_time_factor']:.1f}"),
    ]


def _pressed(use: dict[str, Any]) -> str:
    """How hard, how long and how far the tool has rubbed on a zone."""
    most, bound = use["force_max_n"], use["force_bound_n"]
    beyond = "" if use["force_margin_n"] >= 0.0 else ": too hard"
    if not use["contacts"]:
        return "not touched"
    slip = f"{1000.0 * use['slip_m']:.0f} mm slip"
    return f"up to {most:.2f} N of {bound:g} N{beyond}, {use['contact_s']:.2f} s, {slip}"


def _payload_row(use: dict[str, Any] | None) -> Rows:
    """When the payload was taken up and let go of, where there is one."""
    if use is None:
        return []
    taken, released = use["taken_s"], use["released_s"]
    when = "not taken up" if taken is None else f"taken up at {taken:.2f} s"
    when += "" if released is None else f", released at {released:.2f} s"
    return [(f"payload of {use['mass_kg']:g} kg", when)]


def _asked_row(error: float | None, asked: float | None) -> Rows:
    """The force's error against what was asked for, where anything was."""
    if error is None or asked is None:
        return []
    return [("force error, RMS", f"{error:.2f} N of {asked:.2f} N")]


def _shown(margins: dict[str, float]) -> dict[str, float]:
    """All of a body of three points; of the full body the least of each zone."""
    if not any("/rotor" in key for key in margins):
        return margins
    least: dict[str, str] = {}
    for key in margins:
        zone = key.partition("/")[0]
        least[zone] = min(least.get(zone, key), key, key=margins.__getitem__)
    return {key: margins[key] for key in least.values()}


def _timing_rows(mpc: dict[str, Any], inner: dict[str, Any]) -> Rows:
    if mpc["p50_us"] is None or inner["p50_us"] is None:
        return [("flight software", "no timing")]
    times = (mpc["p50_us"], mpc["p99_us"], mpc["max_us"])
    return [
        ("MPC p50 / p99 / max", " / ".join(f"{time / 1000.0:.2f}" for time in times) + " ms"),
        ("MPC missed deadlines", str(mpc["missed_deadlines"])),
        ("MPC fallbacks", str(mpc["fallbacks"])),
        ("tick p50 / p99", f"{inner['p50_us']:.0f} / {inner['p99_us']:.0f} us"),
        ("ticks late", f"{100.0 * inner['late_share']:.2f} %"),
    ]


def _counts(safety: dict[str, int | None]) -> str:
    return " / ".join("-" if safety[key] is None else str(safety[key]) for key in _SAFETY_KEYS)


def _mm(value: float | None) -> str:
    return "none" if value is None else f"{1000.0 * value:.1f} mm"


def _use(use: dict[str, Any]) -> str:
    """How much of a limit was used, and for how long it was exceeded."""
    largest, most, unit = use["largest"], use["most"], use["unit"]
    if unit == "rad":
        largest, most, unit = math.degrees(largest), math.degrees(most), "deg"
    beyond = f", {use['beyond_s']:.2f} s beyond" if use["beyond_s"] > 0.0 else ""
    return f"{largest:.2f} of {most:.2f} {unit}{beyond}" + ("" if use["kept"] else ": broken")


def _sum_and_mean(value: dict[str, float]) -> str:
    return f"{value['sum']:.1f} / {value['mean']:.3f}"
