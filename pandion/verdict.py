"""The rows of the verdict table."""

from __future__ import annotations

from typing import Any

Rows = list[tuple[str, str]]


def rows(result: dict[str, Any], tracking_max_m: float | None) -> Rows:
    """What a flight comes down to, as text.

    Args:
        result: From :func:`pandion.result.as_json`.
        tracking_max_m: Largest tracking error [m], which the JSON does not carry.
    """
    return [
        ("flown", f"{result['duration_s']:.1f} s"),
        *[(f"margin {name}", _mm(value)) for name, value in result["margins_m"].items()],
        ("minimum margin", _mm(result["min_margin_m"])),
        ("tracking RMS / max", f"{_mm(result['tracking_error_rms_m'])} / {_mm(tracking_max_m)}"),
        ("control effort, sum / mean", _sum_and_mean(result["control_effort"])),
        ("control smoothness, sum / mean", _sum_and_mean(result["control_smoothness"])),
        *_timing_rows(result["mpc"], result["inner"]),
        ("real-time factor", f"{result['real_time_factor']:.1f}"),
    ]


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


def _mm(value: float | None) -> str:
    return "none" if value is None else f"{1000.0 * value:.1f} mm"


def _sum_and_mean(value: dict[str, float]) -> str:
    return f"{value['sum']:.1f} / {value['mean']:.3f}"
