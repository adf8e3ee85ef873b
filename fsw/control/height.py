"""The paper's height loop."""

from __future__ import annotations

from fsw.compiled import compilable
from fsw.control.pid import PidGains, pid_step
from fsw.model.airframe import GRAVITY, Airframe
from fsw.signals import PlanInput, PredictionState, StateEstimate


@compilable
def height_pid(
    airframe: Airframe,
    gains: PidGains,
    integral: float,
    estimate: StateEstimate,
    plan: PredictionState,
    u: PlanInput,
    dt: float,
) -> tuple[float, float]:
    """Total thrust that keeps the planned height.

    Args:
        airframe: Mass and limits.
        gains: On height error [1/s^2], its integral [1/s^3] and rate [1/s].
        integral: Integral of the height error [m s].
        estimate: The vehicle now.
        plan: Where the plan wants the vehicle now.
        u: The plan's input now; its vertical acceleration is fed forward.
        dt: Tick length [s].

    Returns:
        Thrust [N] and the integral to pass back.
    """
    error = plan.p[2] - estimate.p_WB[2]
    rate = plan.v[2] - estimate.v_WB[2]
    correction, kept = pid_step(gains, integral, error, rate, dt)
    a_z = u.a[2] + correction
    return airframe.mass * (GRAVITY - a_z) / max(estimate.R_WB[8], 0.5), kept
