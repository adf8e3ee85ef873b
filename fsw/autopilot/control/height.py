"""The paper's height loop."""

from __future__ import annotations

from fsw.autopilot.control.pid import PidGains, pid_step
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.signals import PlanInput, PredictionState, StateEstimate
from fsw.autopilot.tick_record import Accelerations, Estimate, PlanState
from fsw.compiled import compilable


@compilable
def height_pid(
    airframe: Airframe,
    gains: PidGains,
    integral: float,
    estimate: StateEstimate | Estimate,
    plan: PredictionState | PlanState,
    u: PlanInput | Accelerations,
    dt: float,
) -> tuple[float, float]:
    """Total thrust [N] that keeps the planned height, and the integral to pass back.

    The plan's vertical acceleration is fed forward. ``integral`` [m s] of the height error, tick
    length ``dt`` [s].
    """
    error = plan.p[2] - estimate.p_WB[2]
    rate = plan.v[2] - estimate.v_WB[2]
    correction, kept = pid_step(gains, integral, error, rate, dt)
    a_z = u.a[2] + correction
    return airframe.mass * (GRAVITY - a_z) / max(estimate.R_WB[8], 0.5), kept
