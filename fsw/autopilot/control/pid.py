"""One PID loop, one tick; and the paper's height loop, which is one."""

from __future__ import annotations

from dataclasses import dataclass

from fsw.autopilot.geometry.vectors import clamp_magnitude
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.signals import PlanInput, PredictionState, StateEstimate
from fsw.autopilot.tick_record import Accelerations, Estimate, PlanState
from fsw.compiled import compilable


@dataclass(frozen=True, slots=True)
class PidGains:
    """Gains and output limit of one loop."""

    kp: float
    ki: float
    kd: float
    limit: float


@compilable
def pid_step(
    gains: PidGains, integral: float, error: float, error_rate: float, dt: float
) -> tuple[float, float]:
    """Advance one PID loop by one tick.

    Args:
        gains: Gains and output limit.
        integral: Integral of error returned by the previous tick [error s].
        error: Reference minus measurement [error].
        error_rate: Reference rate minus measured rate [error/s].
        dt: Tick length [s], the nominal one, never a measured one.

    Returns:
        Output limited to ``+-gains.limit`` and the integral to pass back next tick.
    """
    grown = integral + error * dt
    raw = gains.kp * error + gains.ki * grown + gains.kd * error_rate
    output = clamp_magnitude(raw, gains.limit)
    # Integrating while saturated would have to be unwound before the output could leave
    # the limit; keep growth only when it pulls back inside.
    winding_up = raw != output and error * raw > 0.0
    return output, (integral if winding_up else grown)


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
